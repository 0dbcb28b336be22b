"""The simulated robot's ROS 2 side. In the simulator, only this package imports rclpy."""

from robots.shared.ros2.importing import make_importable

make_importable()
