"""The pages process behind the web door, and its answers on their way."""
