import robots.bridge.ros  # noqa: F401  (makes rospy importable)
