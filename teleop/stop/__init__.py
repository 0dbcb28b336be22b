"""Emergency stop and clear, from pages and from programs."""
