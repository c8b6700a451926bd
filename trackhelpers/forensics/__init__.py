"""Which program printed this table? Searches and inversions, and the filters and sensors that make the errors of print."""
