"""The Foxglove door: robots' topics for Lichtblick and Foxglove, which may read only; and Lichtblick itself, served."""
