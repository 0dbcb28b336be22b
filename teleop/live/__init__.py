"""WebSockets: consumers, the hub of each robot, lease renewal, topic and view feeds."""
