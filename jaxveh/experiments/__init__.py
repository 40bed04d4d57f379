"""One folder a paper: configuration, run, and check against the printed numbers."""
