"""Parts of a link that both of its ends use: drive lane, pending stops, limits."""
