"""Drives to places by the robot's own navigation."""
