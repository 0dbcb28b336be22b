"""The simulated robot's ROS side. With `robots.bridge.ros` the only place that imports rospy."""

import robots.bridge.ros  # noqa: F401  (makes rospy importable)
