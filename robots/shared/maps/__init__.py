"""A robot’s map: its cells, and the room at a place."""
