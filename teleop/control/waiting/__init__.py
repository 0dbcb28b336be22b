"""People who wait for control of a robot: the line, and its turns while nobody controls it."""
