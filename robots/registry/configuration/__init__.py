"""The configuration of a robot: checked values from JSON. The robot's own entries replace those of its profile."""
