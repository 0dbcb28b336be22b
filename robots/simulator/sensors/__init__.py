"""Simulated sensors with the faults of real sensors."""
