"""Models of robots for the 3D view."""
