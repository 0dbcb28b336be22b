"""The emergency stop: press, deliver, keep pending, record."""
