"""Actions that only ROS 1 has, and what is different in ROS 1 in the others."""
