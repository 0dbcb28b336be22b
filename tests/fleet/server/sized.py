"""An application for the web process: it answers a number by a text and by bytes of this length.

At `/late` it accepts a WebSocket after a moment.
"""

import asyncio


async def application(scope, receive, send):
    if scope["type"] != "websocket":
        await send({"type": "http.response.start", "status": 200, "headers": [(b"Content-Length", b"0")]})
        await send({"type": "http.response.body"})
        return
    await receive()
    if scope["path"] == "/late":
        await asyncio.sleep(0.2)
    await send({"type": "websocket.accept"})
    while (event := await receive())["type"] == "websocket.receive":
        length = int(event["text"])
        await send({"type": "websocket.send", "text": "x" * length})
        await send({"type": "websocket.send", "bytes": bytes(length)})
