"""The robot's map."""
