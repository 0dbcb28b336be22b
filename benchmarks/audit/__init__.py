"""Benchmark of the audit log: an invented lab's history, and the cost of records while somebody drives."""
