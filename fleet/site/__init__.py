"""The package that joins all apps: URLs, ASGI application, WebSocket access."""
