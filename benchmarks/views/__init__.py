"""Benchmarks of pictures of a robot: camera, 3D view, many viewers."""
