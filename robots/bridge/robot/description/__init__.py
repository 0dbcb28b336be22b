"""A robot's description: when it is read, and what the check of a robot finds in it."""
