"""The inspector, for a robot with any ROS: it answers queries, shows topics, publishes, and calls services."""
