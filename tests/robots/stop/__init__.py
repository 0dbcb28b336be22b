"""The stop on its way to a robot."""
