"""Shared by the console and a robot’s processes. No Django; rospy only in `ros/`."""
