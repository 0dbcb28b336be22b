"""The docs as pages of the console, and their links."""
