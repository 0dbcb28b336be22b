"""The configuration of a robot: from JSON to checked values, and its profile with its own entries on top."""
