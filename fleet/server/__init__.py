"""The server of the web process: Daphne, with limits for unknown clients before Django handles a request.

`limits` has the limits, `connections` counts. `channel` applies both to HTTP, `websocket` to WebSockets.

    python -m fleet.server --port 8000 fleet.site.asgi:application      # same options as Daphne
"""
