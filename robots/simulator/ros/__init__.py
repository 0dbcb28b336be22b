"""The simulated robot's ROS side. With `robots.bridge.ros` the only place that imports rospy."""
