"""Shared parts of benchmarks: processes that observe, publish, read and carry bytes."""
