"""Live camera pictures: the bridge's client of its camera process, and the parts of that process without rospy."""
