"""The client of the inspector."""
