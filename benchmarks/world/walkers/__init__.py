"""People who walk on two shins, drawn by a seed, in a plane world that is faster than MuJoCo.

`gait` moves shins, `plan` draws a run, `plane` measures ranges and distances, `run` plays it with the gate.
"""
