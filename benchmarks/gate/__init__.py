"""Benchmarks of the gate: cost of a decision, and crashes in `benchmarks.world`."""
