"""The bridge: one process for one robot. It decides what the robot's base is told."""
