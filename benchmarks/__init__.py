"""Measurements of the library against its peers and against a hand-vectorised limit: ``python -m benchmarks``."""
