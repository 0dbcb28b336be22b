"""The bridge's ROS side. In the bridge, only this package imports rospy."""

import robots.shared.ros  # noqa: F401  (makes rospy importable)
