"""The simulated robot's own navigation, without ROS: a path on the map, and the twists that follow it."""
