"""The camera process: bad pictures."""
