"""Live camera pictures: the bridge's client of its camera process, and the process's parts without rospy."""
