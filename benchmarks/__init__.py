"""What the ensemble costs beside filterpy, Stone Soup, simdkalman and a loop in C: ``python -m benchmarks`` measures ratios within one run."""
