"""Obstacles: memory, headings, and the cache."""
