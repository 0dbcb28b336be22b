"""Planar geometry of the robot: poses, footprint, arm discs, and arcs to first contact."""
