"""ROS message classes, found or generated."""
