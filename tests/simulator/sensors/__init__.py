"""Simulated odometry and distance sensors."""
