"""What script/bench measures: each module here with a `measure` function is one benchmark.

The figures and their limits are the promises of docs/figures.md.
"""
