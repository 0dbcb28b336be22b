"""The tap of a ROS 1 robot: subscribes to topics while programs read them."""
