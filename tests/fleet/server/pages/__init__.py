"""The pages process behind the web door, and the delivery of its answers."""
