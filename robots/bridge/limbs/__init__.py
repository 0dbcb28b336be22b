"""Gripper and torso: one bounded move of each at a time, which joint states watch."""
