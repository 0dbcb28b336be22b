"""What the console and a robot’s processes both know. No Django; rospy only in `ros/`."""
