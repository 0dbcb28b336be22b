"""Base of all WebSocket consumers: typed messages, flood limit, refusals.

Channels' own loop needs a task and a thread switch for each message. They take 0.3 ms: most of the time that
drive input spends in this process. This loop passes each message directly to `on_message`; slow work runs in
the background.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from typing import Any

from channels.consumer import AsyncConsumer

from fleet.server import AT_ONCE, SEND, WRITABLE
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.sentences import say
from robots.shared.wire import (
    Accepted,
    BookingsReport,
    BrowserReport,
    FleetReport,
    NewsReport,
    Refusal,
    Refused,
    TopicsReport,
    WireError,
    encode,
    heading,
)
from teleop.records import refusals
from teleop.records.refusals import RefusedRequest

log = logging.getLogger(__name__)

FLOOD_PER_S = 200.0  # messages; a joystick sends 30
FLOOD_BURST = 400.0  # so many messages may wait after a stall of some seconds
FLOOD_CLOSES_AFTER = 400  # messages refused for flooding
REPLIES_PER_S = 10.0  # refusals that are sent; more are only counted
REPLIES_BURST = 20.0

BUSY = Refusal("busy", "Too many requests at once: wait for the answers.", "wire")


class CloseCode:
    """Codes with which the server closes a WebSocket; pages act on them."""

    SIGNED_OUT = 4401
    NOT_PERMITTED = 4403
    NOT_FOUND = 4404
    NOT_SPOKEN = 4406  # the client offers no subprotocol that this address has
    FLOOD = 4429
    TRY_AGAIN = 4503


class MessageSocket(AsyncConsumer):
    """Base of the consumers. Subclasses define what happens on open, on a message and on close."""

    subprotocols: tuple[str, ...] = ()  # the best first

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()  # messages not carried out, by code
        self._budget = TokenBucket(FLOOD_PER_S, FLOOD_BURST)
        self._replies = TokenBucket(REPLIES_PER_S, REPLIES_BURST)
        self._closing = False
        self.heard_s = time.monotonic()  # time of the last message

    async def on_open(self) -> None:
        """Run after the handshake."""

    async def on_message(self, raw: str) -> None:
        """Act on a text message. Raises WireError if it is not valid. Must not wait for slow work."""
        raise NotImplementedError

    async def on_bytes(self, raw: bytes) -> None:
        """Act on a binary message. Raises WireError if it is not valid."""
        raise WireError(Refusal("not_text", "Only text frames are accepted.", "wire"))

    def on_message_at_once(self, raw: str) -> bool:
        """Act on a text in the turn of the loop in which it arrives. Return False: `on_message` gets it."""
        return False

    async def on_close(self) -> None:
        """Run after the connection is gone."""

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Run the connection (ASGI application)."""
        self.scope: Any = scope
        extensions = scope.get("extensions", {})
        self.asgi_send = extensions.get(SEND, send)
        await receive()  # websocket.connect
        offered = scope.get("subprotocols", ())
        chosen = next((one for one in self.subprotocols if one in offered), None)
        await send({"type": "websocket.accept", "subprotocol": chosen})
        try:
            await self.on_open()
            if offer := extensions.get(AT_ONCE):
                offer(self._received_at_once)
            while (event := await receive())["type"] != "websocket.disconnect":
                if not self._closing:
                    await self._received(event)
        finally:
            await self.on_close()
            if self.refused:
                log.info(
                    "%s: messages refused on this connection, by code: %s", scope["path"], dict(self.refused)
                )

    def _received_at_once(self, raw: str) -> bool:
        if self._closing or not self.on_message_at_once(raw):
            return False
        self.heard_s = time.monotonic()
        return True

    async def _received(self, event: dict[str, Any]) -> None:
        self.heard_s = time.monotonic()
        raw = event.get("text")
        try:
            if raw is None:
                await self.on_bytes(event["bytes"])
            else:
                await self.on_message(raw)
        except WireError as error:
            of, seq = heading(raw or "")
            if await self.within_budget(of):
                await self.send_refusal(of, error.refusal, seq)

    def is_behind(self) -> bool:
        """Return whether the client has not read what was sent. Other servers than ours do not say so."""
        writable = self.scope.get("extensions", {}).get(WRITABLE)
        return writable is not None and not writable.is_set()

    async def send_message(
        self, message: BrowserReport | TopicsReport | FleetReport | BookingsReport | NewsReport
    ) -> None:
        """Send a message to the client."""
        await self.send_encoded(encode(message).decode())

    async def send_bytes(self, message: bytes) -> None:
        """Send bytes to the client."""
        await self.asgi_send({"type": "websocket.send", "bytes": message})

    async def send_encoded(self, message: str) -> None:
        """Send an encoded message to the client."""
        if not self._closing:
            await self.asgi_send({"type": "websocket.send", "text": message})

    async def send_refusal(
        self, of: str, refusal: Refusal, seq: int | None = None, fence: int | None = None
    ) -> None:
        """Count and record a message that is not carried out. Send the client the reason, at most `REPLIES_PER_S`."""
        self._record_refusal(of, refusal)
        if self._replies.spend(time.monotonic()):
            await self.send_message(Refused(of, refusal, seq, fence))

    async def answer(self, answer: Accepted | Refused) -> None:
        """Send the one answer to a task request or query."""
        if isinstance(answer, Refused):
            self._record_refusal(answer.of, answer.refusal)
        await self.send_message(answer)

    def _record_refusal(self, of: str, refusal: Refusal) -> None:
        self.refused[refusal.code] += 1
        refused = self.refused_request(of, refusal)
        if refused is not None:
            refusals.record_soon(refused)

    def refused_request(self, of: str, refusal: Refusal) -> RefusedRequest | None:
        """Return the facts of a refusal for the audit log; None: record nothing."""
        raise NotImplementedError

    def spend(self) -> bool:
        """Count one message. False: it exceeds the flood limit."""
        return self._budget.spend(time.monotonic())

    async def within_budget(self, of: str) -> bool:
        """Count one message. If it exceeds the flood limit, refuse it and return False; close after many of these."""
        if self.spend():
            return True
        text = say("More than {most:.0f} messages per second.", most=FLOOD_PER_S)
        flood = Refusal("flood", text, "wire", {"limit_per_s": FLOOD_PER_S})
        await self.send_refusal(of, flood)
        if self.refused["flood"] >= FLOOD_CLOSES_AFTER:
            await self.send_message(Refused(of, flood))
            await self.close(CloseCode.FLOOD, flood.text)
        return False

    async def close(self, code: int, reason: str) -> None:
        """Close the connection and ignore further messages."""
        if not self._closing:
            self._closing = True
            await self.asgi_send({"type": "websocket.close", "code": code, "reason": reason})


async def no_such_address(scope: Any, receive: Any, send: Any) -> None:
    """Close a connection at an unknown address, so that the page does not try again (ASGI application)."""
    await receive()  # websocket.connect
    await send({"type": "websocket.accept"})
    await send(
        {"type": "websocket.close", "code": CloseCode.NOT_FOUND, "reason": "There is no such address."}
    )
