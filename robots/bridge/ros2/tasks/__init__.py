"""Capabilities of a robot over rclpy; the module names are those of the ROS 1 side."""
