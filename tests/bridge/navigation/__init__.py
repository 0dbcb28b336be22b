"""Drives to a place."""
