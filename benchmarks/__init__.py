"""Benchmarks of script/bench: `__main__` lists their modules, each of which has a function `measure`.

docs/figures.md promises the figures and their limits. `soak` and `attacks` are those of script/soak.
"""
