"""Drives to a place by the robot's own navigation: localisation, goal, path, hold after a goal. No ROS."""
