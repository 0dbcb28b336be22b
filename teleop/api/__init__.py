"""The REST API: robots, their state, speech and emergency stop."""
