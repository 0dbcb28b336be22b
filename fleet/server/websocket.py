"""WebSockets within limits."""

from __future__ import annotations

from typing import Any

from daphne import ws_protocol

from fleet.server import limits


class WebSocketProtocol(ws_protocol.WebSocketProtocol):  # type: ignore[misc]  # Daphne has no types
    """One WebSocket. Frames and messages are bounded by the server's options."""

    _place: str | None = None

    def onConnect(self, request: Any) -> Any:
        """The handshake was read."""
        answer = super().onConnect(request)
        address = str((self.client_addr or [""])[0])
        if self.server.websockets.take(address):
            self._place = address
        else:
            self.dropConnection(abort=True)
        return answer

    def dataReceived(self, data: bytes) -> None:
        """Bytes. Before the console has accepted it, a page has nothing to say."""
        if self.state == self.STATE_CONNECTING and len(self.data) + len(data) > limits.HANDSHAKE_BYTES * 2:
            self.dropConnection(abort=True)
            return
        super().dataReceived(data)

    def onMessage(self, payload: bytes, isBinary: bool) -> None:
        """A whole message."""
        if self.application_queue.qsize() > limits.MESSAGES_WAITING:
            self.dropConnection(abort=True)
            return
        super().onMessage(payload, isBinary)

    def connectionLost(self, reason: Any) -> None:
        """The connection is gone."""
        server = self.factory.server_class
        server.left(self.transport)
        if self._place is not None:
            server.websockets.give_back(self._place)
            self._place = None
        super().connectionLost(reason)


class Factory(ws_protocol.WebSocketFactory):  # type: ignore[misc]
    """Makes `WebSocketProtocol`s."""

    protocol = WebSocketProtocol
