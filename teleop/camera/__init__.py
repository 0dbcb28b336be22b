"""Live camera pictures for pages: a WebSocket apart from control, with the newest picture for each viewer."""
