"""Messages of sensors, read from their bytes."""
