"""The server of the web process: Daphne, with limits on what strangers may send before Django hears of it.

`limits` holds the rules, `connections` counts; `channel` applies both to HTTP, `websocket` to WebSockets.

    python -m fleet.server --port 8000 fleet.site.asgi:application      # the command line is Daphne's
"""
