"""What bridges put on record."""
