"""Readings of a robot's sensors, after their bytes are read: frames, depth pictures, diagnostics."""
