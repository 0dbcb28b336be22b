"""Benchmarks of a command's way to the robot: drive, stop, stick, slow networks."""
