"""One scenario a paper: its truth and its measurements."""
