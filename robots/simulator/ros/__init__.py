"""The simulated robot's ROS side. Only this package and `robots.bridge.ros` import rospy."""

import robots.bridge.ros  # noqa: F401  (makes rospy importable)
