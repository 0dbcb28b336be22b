"""Robots' descriptions (URDF) and their meshes, as pages get them to draw a robot: kept, reduced, checked."""
