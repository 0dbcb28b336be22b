"""The audit log: who did what with which robot, and the outcome. Append-only, chained by digests.

`services.record` is the only way in. A robot is known here by its UUID, and nothing is imported from the apps above.
"""
