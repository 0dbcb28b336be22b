"""Behaviours that a robot of each ROS must have: one test, run against both."""
