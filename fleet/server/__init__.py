"""The server of the web process: Daphne, with limits for strangers before Django handles a request.

`limits` holds the rules, `connections` counts; `channel` applies both to HTTP, `websocket` to WebSockets.

    python -m fleet.server --port 8000 fleet.site.asgi:application      # the command line is Daphne's
"""
