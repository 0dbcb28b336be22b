"""The recorder, without rospy: keeps the last minute of a robot, and writes recordings as MCAP files."""
