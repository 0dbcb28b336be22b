"""Obstacles: memory, movers, headings, and what is computed again."""
