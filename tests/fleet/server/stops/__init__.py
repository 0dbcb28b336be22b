"""Stops by HTTP through the real web process: their heads and bodies, and floods of other people's stops."""
