"""Sensors on their way to the gate."""
