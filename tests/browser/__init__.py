"""The running console in a real browser."""
