"""The world that judges the gate: scenes as data, a closed loop in one process, and figures from its traces.

MuJoCo decides which objects touch. `python -m benchmarks.world` plays one case and prints its trace.
"""
