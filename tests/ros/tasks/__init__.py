"""Motions, speech, publishing and choices on a robot."""
