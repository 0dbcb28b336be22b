"""The mail server: whether there is one, and a test of it."""
