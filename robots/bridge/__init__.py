"""The bridge: one process for one robot. It decides which commands the robot gets."""
