"""Records of a bridge, as values, and the interface of the log that takes them."""
