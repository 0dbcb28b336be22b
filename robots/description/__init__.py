"""Reduces and checks robots' descriptions (URDF) and meshes, from which pages draw robots."""
