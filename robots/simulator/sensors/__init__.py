"""Simulated sensors with a real one's faults."""
