"""The thesis's experiments: truth, measurements, and its equations as printed."""
