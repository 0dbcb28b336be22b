"""Named places of maps."""
