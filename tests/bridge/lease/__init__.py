"""Grants, fences, and the state that survives a restart."""
