"""Programs with tokens that use a whole console."""
