"""Live camera pictures for pages: a WebSocket separate from control, with the newest picture for each viewer."""
