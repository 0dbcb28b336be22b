"""Pages about the past: control sessions, a robot's use, a person's own data."""
