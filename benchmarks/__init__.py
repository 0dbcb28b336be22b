"""Benchmarks of script/bench: each module with a `measure` function is one.

docs/figures.md promises the figures and their limits.
"""
