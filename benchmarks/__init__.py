"""Benchmarks: one file per question, run by ``python -m benchmarks``. No test depends on a time."""
