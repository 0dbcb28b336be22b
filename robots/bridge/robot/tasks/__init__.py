"""The work of both ROS sides for tasks."""
