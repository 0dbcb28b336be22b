"""Composition: the one place that puts all apps together: URLs, ASGI application, WebSocket access."""
