"""Drive input, its filters, and the drive log."""
