"""Composition: the one place that joins all apps: URLs, ASGI application, WebSocket access."""
