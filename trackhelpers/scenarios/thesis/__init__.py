"""The thesis's experiments: truth and measurements, and equations held against each other."""
