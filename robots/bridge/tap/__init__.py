"""The tap, for both ROS sides: reads whole messages of topics once for all programs, and encodes each form once."""
