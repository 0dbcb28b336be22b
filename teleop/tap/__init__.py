"""Whole messages of topics for programs: each is read from the robot once, and each reader gets the newest."""
