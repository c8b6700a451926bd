"""What the ensemble and the filters of one target cost beside filterpy, Stone Soup, simdkalman and a loop in C: ``python -m benchmarks``."""
