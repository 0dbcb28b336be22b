"""Answers an endless stream to a client that reads nothing; prints the bytes sent, and whether the stream ended."""

import asyncio
import json
import socket
import threading
import time

import daphne.server  # noqa: F401 - first: it chooses Twisted's reactor
from django.conf import settings
from twisted.internet import reactor

from fleet.server import limits
from fleet.server.command import Server

CHUNK = bytes(65536)
MOST_BYTES = 100_000_000
sent_bytes = 0
ended = threading.Event()


async def endless(scope, receive, send):
    global sent_bytes
    await receive()
    gone = asyncio.ensure_future(receive())
    await send({"type": "http.response.start", "status": 200})
    while sent_bytes < MOST_BYTES and not gone.done():
        await send({"type": "http.response.body", "body": CHUNK, "more_body": True})
        sent_bytes += len(CHUNK)
        await asyncio.sleep(0)
    ended.set()


def ask_and_wait(server):
    while not server.listening_addresses:
        time.sleep(0.02)
    with socket.create_connection(server.listening_addresses[0]) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        done = ended.wait(30)
    print(json.dumps({"sent": sent_bytes, "ended": done, "open": len(server.open)}))
    reactor.callFromThread(reactor.stop)


settings.configure(SESSION_COOKIE_NAME="session")
limits.UNREAD_S = 1.0
server = Server(endless, endpoints=["tcp:port=0:interface=127.0.0.1"], verbosity=0, signal_handlers=False)
threading.Thread(target=ask_and_wait, args=[server], daemon=True).start()
server.run()
