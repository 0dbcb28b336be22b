"""The map of a robot, drives to a place, and the fleet map."""
