"""Shared by the console and a robot’s processes. No Django, no rospy."""
