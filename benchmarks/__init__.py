"""Benchmarks of script/bench: each module here with a `measure` function is one.

The figures and their limits are the promises of docs/figures.md.
"""
