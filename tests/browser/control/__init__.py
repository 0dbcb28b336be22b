"""The control page: driving, tabs, limbs, health, topics, 3D view."""
