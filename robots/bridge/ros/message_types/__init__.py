"""ROS message classes, found or generated, and conversion to the gate's values."""
