"""Records of a bridge: their values, the queue, and the writer that survives a crash."""
