"""The simulated robot's ROS side. In the simulator, only this package imports rospy."""

import robots.shared.ros  # noqa: F401  (makes rospy importable)
