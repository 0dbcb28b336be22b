"""Live camera pictures: the bridge's client of its camera process, and what the process does for both ROS sides."""
