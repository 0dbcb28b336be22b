"""Gripper and torso: one limited move of each limb at a time, checked by joint states."""
