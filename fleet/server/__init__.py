"""The server of the web process: Daphne, with limits for unknown clients before Django handles a request.

`limits` has the limits, `connections` counts; `guard` applies both to each connection, and `front` to each request.
`pages/` has the pages process, to which `front` passes most requests.

    python -m fleet.server --port 8000 fleet.site.asgi:application      # same options as Daphne
"""

# Extension of a WebSocket's scope: the application passes it a function that gets each text first, if no other waits.
# If the function returns False, the text comes as an event. An event costs a turn of the loop and a queue.
AT_ONCE = "fleet.at_once"
# Extension of a WebSocket's scope: the server's own `send`, for all after the handshake. The application's `send` asks
# each layer between, such as the session's, about each message.
SEND = "fleet.send"
# Extension of a WebSocket's scope: an `asyncio.Event`, set while the client reads what is sent (64 KiB may wait).
WRITABLE = "fleet.writable"
# Extension of a WebSocket's scope: a function that pings the client, which every WebSocket answers by itself. It gets a
# function, which it calls with the seconds until the answer.
PING = "fleet.ping"
# Extension of a WebSocket's scope: the application calls it to get messages also while the client reads nothing, and
# then bounds what it answers.
READ_ON = "fleet.read_on"
