"""Programs with tokens at a whole console."""
