"""The space that an arm needs, as discs."""
