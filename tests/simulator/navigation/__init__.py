"""The simulated robot's own navigation."""
