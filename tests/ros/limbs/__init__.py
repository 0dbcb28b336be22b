"""Moves of gripper and torso on ROS."""
