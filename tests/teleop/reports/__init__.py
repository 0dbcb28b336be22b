"""Pages and records about the past."""
