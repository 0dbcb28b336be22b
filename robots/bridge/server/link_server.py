"""The bridge's end of the link: a WebSocket server for web processes.

On one computer it is a Unix socket that only its owner can open; between computers TCP with TLS and a shared secret,
never without. Text frames are messages, binary frames are views. A slow web process gets the newest view, never a
queue.
"""

from __future__ import annotations

import asyncio
import hmac
import http
import logging
import os
import secrets
import socket
import ssl
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

from msgspec import Struct
from websockets.asyncio.server import Server, ServerConnection, serve, unix_serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from robots.bridge.config import LinkAddress
from robots.link.lane import Lane, LaneServer
from robots.wire import LaneToken, encode_report

log = logging.getLogger(__name__)

_REPORTS_KEPT = 200  # a web process that reads nothing for this many reports is cut off
_PING_S = 1.0  # over TCP, where a cut cable closes nothing

OnMessage = Callable[["Link", bytes], Awaitable[None]]
OnQuick = Callable[["Link", bytes], object]
OnLink = Callable[["Link"], None]


class Link:
    """One web process."""

    _count = 0

    def __init__(self, socket: ServerConnection) -> None:
        Link._count += 1
        self.number = Link._count
        self.name = ""
        self.greeted = False  # it said hello, and is told what is new
        self.watchers: list[str] = []
        self.watchers_more = 0
        self.token = ""  # of its lane
        self.lane: Lane | None = None
        self._socket = socket
        self._reports: deque[bytes] = deque()
        self._view: bytes | None = None
        self._seen: dict[str, bytes] = {}
        self._news = asyncio.Event()
        self._ending = False

    def report(self, message: Struct) -> None:
        """Queue a report."""
        if len(self._reports) >= _REPORTS_KEPT:
            log.warning("link %s reads nothing: cut off", self.name)
            self.cut()
            return
        self._reports.append(encode_report(message))
        self._news.set()

    def show(self, view: bytes) -> None:
        """Make `view` the next picture; an older one not yet sent is dropped."""
        self._view = view
        self._news.set()

    def see(self, topic: str, seen: bytes) -> None:
        """Make `seen`, a whole report, the next that is said of `topic`; an older one not yet sent is dropped."""
        self._seen[topic] = seen
        self._news.set()

    def end(self) -> None:
        """Close, after what was reported before."""
        self._ending = True
        self._news.set()

    def cut(self) -> None:
        """End it at once."""
        self._socket.transport.abort()

    async def write(self) -> None:
        """Send reports, then the newest view, then what is seen of topics, for as long as the link lives."""
        while True:
            await self._news.wait()
            self._news.clear()
            while self._reports:
                await self._socket.send(self._reports.popleft(), text=True)
            if self._ending:
                await self._socket.close()
                return
            if self._view is not None:
                view, self._view = self._view, None
                await self._socket.send(view)
            if self._seen:
                await self._socket.send(self._seen.pop(next(iter(self._seen))), text=True)
                self._news.set()  # whatever else came meanwhile goes first


class LinkServer:
    """Accepts links and hands on what comes in. The callbacks run on the event loop.

    `on_quick` hears what comes by a link's lane; without it no link has a lane.
    """

    def __init__(
        self,
        address: LinkAddress,
        on_open: OnLink,
        on_message: OnMessage,
        on_close: OnLink,
        on_quick: OnQuick | None = None,
    ) -> None:
        self._address = address
        self._on_open = on_open
        self._on_message = on_message
        self._on_close = on_close
        self._on_quick = on_quick
        self._lanes: LaneServer | None = None
        self.links: set[Link] = set()
        self._deaf = False
        self._server: Server | None = None

    async def start(self) -> None:
        """Listen."""
        address = self._address
        if address.unix_path:
            self._server = await self._listen_unix(address.unix_path)
            if self._on_quick:
                self._lanes = LaneServer(address.unix_path, self._opened_lane)
                self._lanes.open()
        else:
            self._server = await serve(
                self._serve,
                address.host,
                address.port,
                ssl=_tls(address),
                process_request=self._check_secret,
                compression=None,
                ping_interval=_PING_S,
                ping_timeout=_PING_S,
            )

    def read_lanes(self) -> None:
        """Hear what came in by every link's lane so far."""
        for link in list(self.links):
            if link.lane:
                link.lane.read_all()

    def shut(self) -> None:
        """From now on nothing that comes in is heard, and no link opens; `close` follows."""
        self._deaf = True
        self._accept_no_more()

    async def close(self) -> None:
        """Close every link and the socket files."""
        self._accept_no_more()
        if self._server:
            await self._server.wait_closed()
        if self._address.unix_path:
            _remove(self._address.unix_path)

    def _accept_no_more(self) -> None:
        if self._server:
            self._server.close()
        if self._lanes:
            self._lanes.close()

    async def _listen_unix(self, path: str) -> Server:
        _remove(path)  # the state file's lock says that nobody else is this bridge
        umask = os.umask(0o177)
        try:
            return await unix_serve(self._serve, path, compression=None, ping_interval=None)
        finally:
            os.umask(umask)

    async def _serve(self, socket: ServerConnection) -> None:
        link = Link(socket)
        self.links.add(link)
        writer = asyncio.create_task(link.write())
        try:
            self._on_open(link)
            if self._lanes:
                link.token = secrets.token_urlsafe()
                link.report(LaneToken(link.token))
            while True:
                raw = await socket.recv(decode=False)
                if link.lane:
                    link.lane.read_all()  # it was sent before: a command is not overtaken by the word that ends control
                if not self._deaf:
                    await self._on_message(link, raw)
        except ConnectionClosed:
            pass
        finally:
            self.links.discard(link)
            if link.lane:
                link.lane.close()
            self._on_close(link)
            writer.cancel()
            with suppress(asyncio.CancelledError, ConnectionClosed):
                await writer

    def _opened_lane(self, token: str, end: socket.socket) -> None:
        for link in self.links:
            if link.lane is None and hmac.compare_digest(link.token.encode(), token.encode()):

                def hear(message: bytes, link: Link = link) -> None:
                    if self._on_quick and not self._deaf:
                        self._on_quick(link, message)

                link.lane = Lane(end, hear, link.cut)
                return
        log.warning("a lane with a strange token was refused")
        end.close()

    def _check_secret(self, _socket: ServerConnection, request: Request) -> Response | None:
        expected = f"Bearer {self._address.secret}"
        given = request.headers.get("Authorization", "")
        if self._address.secret and hmac.compare_digest(given.encode(), expected.encode()):
            return None
        log.warning("a link without the shared secret was refused")
        return _socket.respond(http.HTTPStatus.UNAUTHORIZED, "The shared secret is missing or wrong.\n")


def _remove(path: str) -> None:
    """Make sure that the socket's folder is there, ours alone, and the socket is not."""
    Path(path).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    Path(path).unlink(missing_ok=True)


def _tls(address: LinkAddress) -> ssl.SSLContext:
    """TLS 1.2 or newer with our certificate; without certificate and secret a TCP link does not open."""
    if not (address.certificate and address.private_key and address.secret):
        raise ValueError("a TCP link needs a certificate, a private key and a shared secret")
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(address.certificate, address.private_key)
    return context
