"""The web process's end of a bridge link: WebSocket client, local lane, pending replies."""
