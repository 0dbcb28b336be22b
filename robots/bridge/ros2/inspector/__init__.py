"""The inspector of a robot with ROS 2."""
