"""Small faults put into the package, one at a time: does the folder of tests of the module notice? `make mutants` runs it."""
