"""Serves an endless page; prints the bytes sent, and whether the console ended it.

The client reads nothing and disconnects once all buffers are full (`leaves`), or stays connected and is
disconnected (`stays`); or it `reads` slowly, for longer than a client may leave data unread.
"""

import json
import socket
import sys
import tempfile
import threading
import time
from pathlib import Path

import daphne.server  # noqa: F401 - first: it chooses Twisted's reactor
from django.conf import settings
from twisted.internet import protocol, reactor

from fleet.server import limits
from fleet.server.command import Server
from fleet.server.pages.client import Pages

CHUNK = bytes(65536)
PIECES = b"".join(b"1000\r\n" + CHUNK[:4096] + b"\r\n" for _ in range(16))
UNREAD_S = 1.0
[way] = sys.argv[1:]
opened = threading.Event()
closed = threading.Event()
sent_bytes = 0


class Endless(protocol.Protocol):
    def dataReceived(self, _data):
        self.transport.write(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n")
        self.transport.registerProducer(self, False)
        opened.set()

    def resumeProducing(self):
        global sent_bytes
        sent_bytes += len(CHUNK)
        self.transport.write(PIECES)

    def stopProducing(self):
        pass

    def connectionLost(self, _reason):
        closed.set()


def ask_and_leave(server):
    while not server.listening_addresses:
        time.sleep(0.02)
    with socket.create_connection(server.listening_addresses[0]) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        opened.wait(30)
        before = -1
        while way == "leaves" and before != sent_bytes:  # until all buffers are full
            before = sent_bytes
            time.sleep(0.5)
        until_s = time.monotonic() + 3 * UNREAD_S
        while way == "reads" and time.monotonic() < until_s:
            if not client.recv(16384):
                raise ConnectionError("the console ended an answer that is read")
            time.sleep(0.0002)  # slower than the server sends
        in_time = way != "stays" or closed.wait(30)
    print(
        json.dumps(
            {"sent": sent_bytes, "closed": closed.wait(30) and in_time, "taken": server.front.requests.taken}
        )
    )
    reactor.callFromThread(reactor.stop)


with tempfile.TemporaryDirectory() as directory:
    path = Path(directory) / "pages.sock"
    settings.configure(SESSION_COOKIE_NAME="session")
    limits.UNREAD_S = 60.0 if way == "leaves" else UNREAD_S
    factory = protocol.ServerFactory()
    factory.protocol = Endless
    reactor.listenUNIX(str(path), factory)
    server = Server(None, endpoints=["tcp:port=0:interface=127.0.0.1"], verbosity=0, signal_handlers=False)
    server.front.pages = Pages(path)
    threading.Thread(target=ask_and_leave, args=[server], daemon=True).start()
    server.run()
