"""Diagnostics of a robot on ROS."""
