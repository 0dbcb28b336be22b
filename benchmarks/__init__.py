"""Benchmarks of script/bench: `__main__` lists their modules. Each module has a function `measure`.

docs/figures.md lists the promised figures and their limits. script/soak runs `soak` and `attacks`.
"""
