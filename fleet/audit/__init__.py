"""The audit log: persons, their actions with robots, and outcomes. Append-only, chained by digests.

`services.record` is the only way in. A robot is known here by its UUID, and nothing is imported from the apps above.
"""
