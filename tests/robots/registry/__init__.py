"""Robots, profiles, roles, phrases, allow-lists."""
