"""Health of the robot: diagnostics, battery, records."""
