"""Parts of both ROS sides of a bridge: neither rospy nor rclpy is known here. `sides.py` picks a robot's side."""
