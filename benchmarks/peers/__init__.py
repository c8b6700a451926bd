"""The libraries that the ensemble is measured against, each on the same data, and as its own documentation writes a loop."""
