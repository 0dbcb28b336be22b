"""The watchdog's socket: one datagram is one message, and a connection reports when its other end closes."""

from __future__ import annotations

import contextlib
import os
import selectors
import socket
from pathlib import Path
from typing import NamedTuple

LARGEST = 16 * 1024  # bytes of a message
MOST = 100  # limit of connections; beyond it the oldest is closed
BACKLOG = 32


class ReceivedMessage(NamedTuple):
    """A message; None: the other end closed."""

    connection: socket.socket
    message: bytes | None


class WatchdogSocket:
    """Server of a SEQPACKET Unix socket that only its owner can open. Only `wait` blocks."""

    def __init__(self, path: str, life_line: int | None = None) -> None:
        Path(path).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        Path(path).unlink(missing_ok=True)
        self._path = path
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        umask = os.umask(0o177)
        try:
            self._listener.bind(path)
        finally:
            os.umask(umask)
        self._file = _file_at(path)
        self._listener.listen(BACKLOG)
        self._listener.setblocking(False)
        self._connections: dict[socket.socket, None] = {}  # in order of arrival
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._life_line = life_line
        self.ended = False  # the life line closed
        if life_line is not None:
            os.set_blocking(life_line, False)
            self._selector.register(life_line, selectors.EVENT_READ)

    def wait(self, timeout_s: float) -> list[ReceivedMessage]:
        """Return everything that arrived; wait at most `timeout_s` for it."""
        heard: list[ReceivedMessage] = []
        for key, _ in self._selector.select(max(timeout_s, 0.0)):
            if key.fileobj is self._listener:
                self._accept()
            elif key.fileobj == self._life_line:
                self._listen_to_life()
            elif isinstance(key.fileobj, socket.socket):
                heard += self._read(key.fileobj)
        return heard

    def send(self, connection: socket.socket, message: bytes) -> None:
        """Send without blocking. If the receiver does not read, the message is lost."""
        with contextlib.suppress(OSError):
            connection.send(message, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)

    def drop(self, connection: socket.socket) -> None:
        if connection in self._connections:
            del self._connections[connection]
            self._selector.unregister(connection)
            connection.close()

    def close(self) -> None:
        """Close everything; remove the socket file, unless a newer watchdog has replaced it."""
        for connection in list(self._connections):
            self.drop(connection)
        self._selector.close()
        # check before the listener closes: until then no other file can have this inode
        if _file_at(self._path) == self._file:
            Path(self._path).unlink(missing_ok=True)
        self._listener.close()

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError:  # the client has closed already
            return
        connection.setblocking(False)
        if len(self._connections) >= MOST:
            self.drop(next(iter(self._connections)))
        self._connections[connection] = None
        self._selector.register(connection, selectors.EVENT_READ)

    def _read(self, connection: socket.socket) -> list[ReceivedMessage]:
        """Read all waiting messages: a bridge whose heartbeat is queued is not silent."""
        heard: list[ReceivedMessage] = []
        while connection in self._connections:
            try:
                message = connection.recv(LARGEST)
            except BlockingIOError:
                break
            except OSError:
                message = b""
            heard.append(ReceivedMessage(connection, message or None))
            if not message:
                self.drop(connection)
        return heard

    def _listen_to_life(self) -> None:
        assert self._life_line is not None  # noqa: S101  (it is registered)
        with contextlib.suppress(BlockingIOError):
            if not os.read(self._life_line, 1024):
                self.ended = True
                self._selector.unregister(self._life_line)


def _file_at(path: str) -> tuple[int, int] | None:
    """Return device and inode of the file; None if it does not exist."""
    try:
        found = Path(path).stat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino
