"""The web door: limits, sign-in, stops, slow readers, and the pages process behind it."""
