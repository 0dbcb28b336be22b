"""Convert measurements to points in the base frame."""
