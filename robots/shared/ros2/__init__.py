"""The needs of every process that speaks with ROS 2 before it starts: where rclpy lies, and its environment.

No module here imports rclpy. `definitions/` has the message packages that neither PyPI nor every robot has.
"""
