"""How the tap reads topics of a robot with ROS 2."""
