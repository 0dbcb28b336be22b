"""What both ROS sides do for tasks."""
