"""The WebSocket consumers, one for each kind of page, and their common base."""
