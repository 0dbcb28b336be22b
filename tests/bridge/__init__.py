"""The bridge without ROS: its core and its parts."""
