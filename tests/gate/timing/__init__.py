"""Time in the gate: latency, acknowledgements, stale data, restarts."""
