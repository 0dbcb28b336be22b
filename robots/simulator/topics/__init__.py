"""The simulated robot's topics, whichever ROS carries them."""
