"""The fleet's processes."""
