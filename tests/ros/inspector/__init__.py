"""Topics, types and definitions."""
