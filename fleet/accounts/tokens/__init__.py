"""Tokens with which programs sign in: made, listed and ended by people; bound to scopes and robots."""
