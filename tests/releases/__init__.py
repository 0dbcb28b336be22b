"""Databases of past releases: upgraded to this one, and restored."""
