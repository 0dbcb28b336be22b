"""WebSockets: pages, views, topics, tasks."""
