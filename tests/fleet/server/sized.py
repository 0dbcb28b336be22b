"""An application for the web process: it answers a number by a text and by bytes of this length.

At `/late` it accepts a WebSocket after a moment. "much" sends bytes until the client is behind, then the number of
messages as soon as it is no more.
"""

import asyncio

from fleet.server import WRITABLE

CHUNK = bytes(1024 * 1024)


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
        if event["text"] == "much":
            sent, writable = 0, scope["extensions"][WRITABLE]
            while writable.is_set():
                await send({"type": "websocket.send", "bytes": CHUNK})
                sent += 1
                await asyncio.sleep(0.01)
            await writable.wait()
            await send({"type": "websocket.send", "text": str(sent)})
            continue
        length = int(event["text"])
        await send({"type": "websocket.send", "text": "x" * length})
        await send({"type": "websocket.send", "bytes": bytes(length)})
