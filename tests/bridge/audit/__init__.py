"""Records of the bridge."""
