"""What the two ROS sides of a bridge share: neither rospy nor rclpy is known here. `sides.py` picks a robot's side."""
