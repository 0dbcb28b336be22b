"""The simulated robot without ROS: faults, speech, worlds, and its parts."""
