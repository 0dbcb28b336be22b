"""The Foxglove door, and Lichtblick that the console serves."""
