"""The cameras of a robot with ROS 1, for the camera process."""
