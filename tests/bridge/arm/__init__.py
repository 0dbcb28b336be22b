"""Moves of gripper and torso."""
