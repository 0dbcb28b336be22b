"""The rosbridge door: rosbridge protocol v2 over a WebSocket, translated to control, tasks and topics."""
