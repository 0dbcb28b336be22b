"""WebSockets with limits."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from daphne import ws_protocol
from twisted.internet.tcp import Connection

from fleet.base.network_addresses import network_of
from fleet.server import limits
from fleet.server.text_frame import small_text_frame

# Extensions of a connection's scope. To this one, a consumer passes a function that receives texts at once.
DIRECT_RECEIVER = "fleet.direct_receiver"
# To this one, a consumer passes bytes that are sent at once.
DIRECT_SENDER = "fleet.direct_sender"


class WebSocketProtocol(ws_protocol.WebSocketProtocol):  # type: ignore[misc]  # Daphne has no types
    """One WebSocket. The server's options limit the size of frames and messages that a client sends."""

    maxMessagePayloadSize: int  # Autobahn's
    _place: str | None = None
    _direct_receiver: Callable[[str], bool] | None = None

    def set_direct_receiver(self, receive: Callable[[str], bool]) -> None:
        """Pass texts to `receive` without a turn of the loop.

        If it returns False, the text goes to the queue.
        """
        self._direct_receiver = receive

    def send_directly(self, message: bytes) -> bool:
        """Send a message directly, not through Channels and Daphne.

        Return False if the connection is not open.
        """
        if self.state != self.STATE_OPEN:
            return False
        self.sendMessage(message, True)
        return True

    def sendMessage(self, *message: Any, **options: Any) -> None:
        """Send a message of any size. Autobahn would apply the limit for messages of clients."""
        limit, self.maxMessagePayloadSize = self.maxMessagePayloadSize, 0
        try:
            super().sendMessage(*message, **options)
        finally:
            self.maxMessagePayloadSize = limit

    def handle_reply(self, message: dict[str, Any]) -> None:
        """Do as the application says. Daphne would close without the reason, which a program shows to people."""
        if message["type"] == "websocket.close" and self.state == self.STATE_OPEN:
            self.sendClose(message.get("code") or 1000, message.get("reason") or None)
        else:
            super().handle_reply(message)

    def onConnect(self, request: Any) -> Any:
        """Take a place among the connections after the handshake, or drop the connection."""
        answer = super().onConnect(request)
        address = network_of(str((self.client_addr or [""])[0]))
        if self.server.websockets.take(address):
            self._place = address
        else:
            self.dropConnection(abort=True)
        return answer

    def dataReceived(self, data: bytes) -> None:
        """Read bytes. Until the console has accepted the WebSocket, a page may send only its handshake."""
        if self.state == self.STATE_CONNECTING and len(self.data) + len(data) > limits.HANDSHAKE_BYTES * 2:
            self.dropConnection(abort=True)
            return
        if self.state == self.STATE_OPEN and self._is_between_messages():
            text = small_text_frame(data)
            if text is not None:
                self._on_text(text)
                return
        super().dataReceived(data)

    def _is_between_messages(self) -> bool:
        """Return whether the parser has no part of a message and waits for no pong (any frame counts)."""
        return not (self.data or self.current_frame or self.inside_message or self.autoPingTimeoutCall)

    def _on_text(self, text: str) -> None:
        """Pass a complete text on. If another text waits in the queue, this one waits, too."""
        if self._direct_receiver and self.application_queue.empty() and self._direct_receiver(text):
            self.last_ping = time.time()
        else:
            self.onMessage(text.encode(), False)

    def sendData(self, data: bytes, sync: bool = False, chopsize: int | None = None) -> None:
        """Send bytes to the page, at once if the kernel accepts them.

        This saves a turn of the loop for each page.
        """
        if self.state == self.STATE_OPEN and not (sync or chopsize or self.send_queue):
            data = data[self._written_now(data) :]
        if data:
            super().sendData(data, sync, chopsize)

    def _written_now(self, data: bytes) -> int:
        """Write bytes at once. Return how many: 0 if older bytes wait, or if the connection is encrypted."""
        transport = self.transport
        if (
            not isinstance(transport, Connection)
            or transport.TLS
            or transport.disconnecting
            or not transport.connected
            or transport.dataBuffer
            or transport._tempDataBuffer
        ):
            return 0
        written = transport.writeSomeData(data)
        return written if isinstance(written, int) else 0  # broken: Daphne's own way handles that

    def onMessage(self, payload: bytes, isBinary: bool) -> None:
        """Handle a complete message. Drop the connection if too many messages wait."""
        if self.application_queue.qsize() > limits.MESSAGES_WAITING:
            self.dropConnection(abort=True)
            return
        super().onMessage(payload, isBinary)

    def connectionLost(self, reason: Any) -> None:
        """Handle the end of the connection: give back its places."""
        server = self.factory.server_class
        server.left(self.transport)
        if self._place is not None:
            server.websockets.give_back(self._place)
            self._place = None
        super().connectionLost(reason)


class Factory(ws_protocol.WebSocketFactory):  # type: ignore[misc]
    """Makes `WebSocketProtocol`s."""

    protocol = WebSocketProtocol
