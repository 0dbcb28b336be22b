"""The recorder, for both ROS sides: keeps the last minute of a robot, and writes recordings as MCAP files."""
