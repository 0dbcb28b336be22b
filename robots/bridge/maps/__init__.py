"""The robot's map: fetched, reduced and kept."""
