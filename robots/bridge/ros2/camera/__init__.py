"""The cameras of a robot with ROS 2, for the camera process."""
