"""The bridge's end of the link: a WebSocket server for web processes.

On one computer it listens on a Unix socket that only its owner can open; between computers on TCP, always with TLS and
a shared secret. Text frames are messages, binary frames are views. A slow web process gets the newest view, never a
queue of old views.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import secrets
import socket
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress

from msgspec import Struct
from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed

from robots.bridge.server.listening import is_here, listen, remove_socket
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.lane import Lane, LaneServer
from robots.shared.wire import LaneToken, encode_report

log = logging.getLogger(__name__)

_REPORTS_KEPT = 200  # reports queued for a web process that reads nothing; beyond this its link is cut

OnMessage = Callable[["Link", bytes], Awaitable[None]]
OnQuick = Callable[["Link", bytes], object]
OnLink = Callable[["Link"], None]


class Link:
    """The link to one web process."""

    _count = 0

    def __init__(self, socket: ServerConnection) -> None:
        Link._count += 1
        self.number = Link._count
        self.name = ""
        self.greeted = False  # it has sent its hello; from then on it gets reports
        self.watchers: list[str] = []
        self.watchers_more = 0
        self.joints_wanted = False  # a watcher's page draws the robot's joints
        self.token = ""  # authenticates its drive lane
        self.lane: Lane | None = None
        self._socket = socket
        self._reports: deque[bytes] = deque()
        self._view: bytes | None = None
        self._samples: dict[str, bytes] = {}
        self._news = asyncio.Event()
        self._ending = False

    def report(self, message: Struct) -> None:
        """Queue a report."""
        if len(self._reports) >= _REPORTS_KEPT:
            log.warning("link %s is cut: it reads nothing", self.name)
            self.cut()
            return
        self._reports.append(encode_report(message))
        self._news.set()

    def show(self, view: bytes) -> None:
        """Send `view` next; it replaces an older view that is not sent yet."""
        self._view = view
        self._news.set()

    def show_sample(self, topic: str, sample: bytes) -> None:
        """Send the encoded report `sample` about `topic`; it replaces an older one that is not sent yet."""
        self._samples[topic] = sample
        self._news.set()

    def close_when_sent(self) -> None:
        """Close after the queued reports are sent."""
        self._ending = True
        self._news.set()

    def cut(self) -> None:
        """Cut the link at once."""
        self._socket.transport.abort()

    async def write(self) -> None:
        """Send reports, then the newest view, then samples of topics, while the link lives."""
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
            if self._samples:
                await self._socket.send(self._samples.pop(next(iter(self._samples))), text=True)
                self._news.set()  # reports that arrived during the sending go first


class LinkServer:
    """Accept links and pass messages on. The callbacks run on the event loop.

    `on_quick` gets the messages of drive lanes; without it links have no lane.
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
        self._servers: list[Server] = []

    async def start(self) -> None:
        self._servers = await listen(self._address, self._serve)
        if self._address.unix_path and self._on_quick:
            self._lanes = LaneServer(self._address.unix_path, self._opened_lane)
            self._lanes.open()

    def read_lanes(self) -> None:
        """Read the waiting messages of all drive lanes."""
        for link in list(self.links):
            if link.lane:
                link.lane.read_all()

    def shut(self) -> None:
        """Ignore new messages and links from now on; call `close` next."""
        self._deaf = True
        self._accept_no_more()

    async def close(self) -> None:
        """Close all links and socket files."""
        self._accept_no_more()
        for server in self._servers:
            await server.wait_closed()

    def _accept_no_more(self) -> None:
        for server in self._servers:
            server.close()
        if self._address.unix_path:
            # At once: a process that is not done in time leaves no file.
            remove_socket(self._address.unix_path)
        if self._lanes:
            self._lanes.close()

    async def _serve(self, socket: ServerConnection) -> None:
        link = Link(socket)
        self.links.add(link)
        writer = asyncio.create_task(link.write())
        try:
            self._on_open(link)
            if self._lanes and is_here(socket):
                link.token = secrets.token_urlsafe()
                link.report(LaneToken(link.token))
            while True:
                raw = await socket.recv(decode=False)
                if link.lane:
                    # lane messages were sent earlier: the end of control must not overtake a command
                    link.lane.read_all()
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

                def handle(message: bytes, link: Link = link) -> None:
                    if self._on_quick and not self._deaf:
                        self._on_quick(link, message)

                link.lane = Lane(end, handle, link.cut)
                return
        log.warning("a drive lane with an unknown token was refused")
        end.close()
