"""A robot's messages on their way from a side's threads to the core."""
