"""How fast: one file a question, run by ``python -m benchmarks``. No time decides a test."""
