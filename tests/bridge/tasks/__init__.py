"""Motions, speech, publishing, choices."""
