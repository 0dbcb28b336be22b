"""The lane of a link: a second Unix socket for messages that must be quick.

A message on the link's WebSocket takes 0.3 ms for frames, tasks and buffers. The lane is a SEQPACKET socket: a message
is one datagram, which one call sends and one call reads. Drive input, stops and reports of lateness use the lane; their
answers and all other messages use the WebSocket. Bridges on other computers have no lane.

A lane belongs to one link: the bridge sends each link a token, and the lane's first datagram is that token. If the lane
ends, the WebSocket ends too, and the other way round.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable
from pathlib import Path

from robots.shared.wire import LARGEST_MESSAGE_BYTES

log = logging.getLogger(__name__)

# About thirty messages may wait for a bridge that does not read; then `send` drops messages.
_WAITING_BYTES = 16 * 1024
_MOST_AT_ONCE = 100  # datagrams read before a message of the WebSocket: more than can wait
_TOKEN_S = 1.0  # for the first datagram
_PAUSE_S = 1.0  # after an error of the listening socket


def lane_path(unix_path: str) -> str:
    """Return the path of the lane's socket, which is next to the WebSocket's."""
    return str(Path(unix_path).with_suffix(".lane"))


class Lane:
    """One end of a lane, on the running event loop. Passes datagrams to `on_datagram`.

    `on_end` is called once, if the other side closes the lane or an error occurs, but not after `close`.
    """

    def __init__(
        self, end: socket.socket, on_datagram: Callable[[bytes], object], on_end: Callable[[], None]
    ) -> None:
        self._socket: socket.socket | None = end
        self._on_datagram = on_datagram
        self._on_end = on_end
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(end, self._read)

    @classmethod
    def connect(cls, unix_path: str, token: str, on_end: Callable[[], None]) -> Lane:
        """Return the web process's end of the lane next to the WebSocket at `unix_path`. Raises OSError."""
        end = _socket()
        try:
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _WAITING_BYTES)
            end.connect(lane_path(unix_path))
            end.send(token.encode())
        except OSError:
            end.close()
            raise
        return cls(end, lambda _: None, on_end)

    def send(self, message: bytes) -> bool:
        """Send one datagram. Returns False if the other side does not read or is gone."""
        if self._socket is None:
            return False
        try:
            self._socket.send(message)
        except BlockingIOError:
            return False
        except OSError:
            self._ended()
            return False
        return True

    def read_all(self) -> None:
        """Read all datagrams that have arrived."""
        for _ in range(_MOST_AT_ONCE):
            if not self._read():
                return

    def close(self) -> None:
        """Close this end."""
        if self._socket is not None:
            self._loop.remove_reader(self._socket)
            self._socket.close()
            self._socket = None

    def _read(self) -> bool:
        """Read one datagram in each turn of the loop, so that a flood does not block other work."""
        if self._socket is None:
            return False
        try:
            message = self._socket.recv(LARGEST_MESSAGE_BYTES + 1)  # one byte more shows that it is too large
        except BlockingIOError:
            return False
        except OSError:
            message = b""
        if not message:
            self._ended()
            return False
        try:
            self._on_datagram(message)
        except Exception:
            log.exception("a message of a lane cannot be handled: its link ends")
            self._ended()
            return False
        return True

    def _ended(self) -> None:
        self.close()
        self._on_end()


class LaneServer:
    """The bridge's side. Accepts sockets, and passes each with its token to `on_lane`, which closes unknown ones."""

    def __init__(self, unix_path: str, on_lane: Callable[[str, socket.socket], None]) -> None:
        self._path = lane_path(unix_path)
        self._on_lane = on_lane

    def open(self) -> None:
        """Listen; only this process's user may connect."""
        Path(self._path).unlink(missing_ok=True)
        self._listener = _socket()
        umask = os.umask(0o177)
        try:
            self._listener.bind(self._path)
        finally:
            os.umask(umask)
        self._listener.listen()
        self._accepting = asyncio.create_task(self._accept())

    def close(self) -> None:
        """Stop accepting. Open lanes stay with their links."""
        self._accepting.cancel()
        self._listener.close()
        Path(self._path).unlink(missing_ok=True)

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                end, _ = await loop.sock_accept(self._listener)
            except OSError:
                log.exception("no lane can be accepted")
                await asyncio.sleep(_PAUSE_S)
                continue
            try:
                token = await asyncio.wait_for(loop.sock_recv(end, LARGEST_MESSAGE_BYTES), _TOKEN_S)
            except (TimeoutError, OSError):
                end.close()
                continue
            self._on_lane(token.decode(errors="replace"), end)


def _socket() -> socket.socket:
    found = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    found.setblocking(False)
    return found
