"""The audit log: people, their actions with robots, and outcomes. Append-only, chained by digests.

Records are added only by `services.record` and `record_all`. This app refers to robots by their UUIDs, and
imports nothing from the apps above.
"""
