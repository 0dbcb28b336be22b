"""Tasks over ROS: actions, motions, speech and publishing."""
