"""WebSockets: pages, pictures, topics, tasks."""
