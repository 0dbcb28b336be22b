"""Obstacles: memory, movers, headings, and the cache."""
