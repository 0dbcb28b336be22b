"""The world that judges the gate: scenes as data, a closed loop in one process, and what is made of its traces.

MuJoCo decides what touches what. `python -m benchmarks.world --help` plays one case and prints its trace.
"""
