"""Drives to a place by the robot's own navigation: localisation, goal, path, and what must not go on. No ROS."""
