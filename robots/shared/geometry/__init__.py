"""Poses, arcs and the footprint in the plane."""
