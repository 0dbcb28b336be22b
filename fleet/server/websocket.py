"""A WebSocket between Daphne and its application. docs/decisions/public-interfaces.md: what it reads of Autobahn."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from fleet.server import limits
from fleet.server.guard import Guard
from fleet.server.text_frame import message_frame, small_text_frame

_PING = b"fleet"
_SHARED_LENGTH = (
    256 * 1024
)  # longer messages have few readers; to find their frame would take longer than to make it

_shared_frame = lru_cache(maxsize=8)(message_frame)  # hundreds of pages get the same message at the same time


class WebSocket:
    """Receives and sends for the application. Messages go out without a turn of the loop."""

    def __init__(self, guard: Guard, receive: Any, send: Any) -> None:
        self._guard = guard
        self._receive = receive
        self._send = send
        self._take: Callable[[str], bool] | None = None
        if (socket := guard.wrappedProtocol) is not None:
            self._socket = socket
            socket.failByDrop = False  # a client reads why, such as 1009: too large
            socket.onPing = self._on_ping
            self._queue, socket.onMessage = socket.onMessage, self._on_message
            guard.take = self._on_bytes

    def receive_at_once(self, take: Callable[[str], bool]) -> None:
        """Pass each text to `take` first, unless other messages wait."""
        self._take = take

    def ping(self, answered: Callable[[float], None]) -> None:
        """Ping the client, and pass the seconds until its answer."""
        if (socket := self._guard.wrappedProtocol) is not None:
            sent_s = time.monotonic()
            socket.onPong = lambda payload: answered(time.monotonic() - sent_s) if payload == _PING else None
            socket.sendPing(_PING)

    def _on_ping(self, payload: bytes) -> None:
        """Answer a ping, unless the client does not read: else its pings would fill the memory (`READ_ON`)."""
        if self._guard.writable.is_set():
            self._socket.sendPong(payload)

    def _on_bytes(self, data: bytes) -> bool:
        """Take one small text without Autobahn's reader, which would take longer than the way to the robot's bridge."""
        socket = self._socket
        if socket.state != socket.STATE_OPEN or socket.data or socket.current_frame or socket.inside_message:
            return False
        payload = small_text_frame(data)
        if payload is not None:
            self._on_message(payload, False)
        return payload is not None

    def _on_message(self, payload: bytes, is_binary: bool) -> None:
        """Take a message, by Autobahn's callback."""
        take = self._take if self._guard.is_heard and not is_binary else None
        if take is None or not take(payload.decode()):
            self._guard.is_heard = False
            self._guard.unread_bytes += limits.MESSAGE_COST_BYTES
            self._queue(payload, is_binary)

    async def receive(self) -> Any:
        """Return the next event. While the application does not ask, the client can send only `UNREAD_BYTES`."""
        guard = self._guard
        guard.is_heard = True
        if guard.unread_bytes > limits.UNREAD_BYTES:
            asyncio.get_running_loop().call_soon(self._read_on)
        event = await self._receive()
        guard.is_heard = False
        return event

    def _read_on(self) -> None:
        if self._guard.is_heard:  # no other message waits
            self._guard.unread_bytes = 0
            self._guard.read_on()

    async def send(self, event: dict[str, Any]) -> None:
        """Send an event. Daphne closes without a reason, and its limit for messages is that of clients."""
        socket = self._guard.wrappedProtocol
        if not self._guard.is_accepted:
            await self._send(event)
            self._guard.is_accepted = event["type"] == "websocket.accept"
        elif socket is None or socket.state != socket.STATE_OPEN:
            return
        elif event["type"] == "websocket.close":
            socket.sendClose(event.get("code") or 1000, event.get("reason") or None)
        else:
            payload = event["text"] if event.get("bytes") is None else event["bytes"]
            framed = _shared_frame if len(payload) <= _SHARED_LENGTH else message_frame
            self._guard.write_at_once(framed(payload))
