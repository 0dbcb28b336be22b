"""Sensor topics and frames, converted for the gate."""
