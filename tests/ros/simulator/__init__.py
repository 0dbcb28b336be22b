"""The simulated robot on ROS."""
