"""Reads a robot's description (URDF) as far as RViz uses it, and says what is left out. Pure."""
