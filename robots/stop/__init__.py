"""The emergency stop's way to a robot: press, deliver, keep pending, record."""
