"""Drives to a place on ROS, and the watch over them."""
