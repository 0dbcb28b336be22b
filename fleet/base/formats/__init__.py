"""Formats of times and numbers on pages, by language."""
