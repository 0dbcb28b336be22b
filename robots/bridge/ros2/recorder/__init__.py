"""How the recorder reads topics of a robot with ROS 2."""
