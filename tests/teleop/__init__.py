"""The web process: control, live connections, stops, camera, API, reports, webhooks, and permissions."""
