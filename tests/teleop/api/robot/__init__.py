"""Robots at the API: state, stop, speech, description."""
