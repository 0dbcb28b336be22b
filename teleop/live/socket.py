"""A WebSocket that speaks typed messages: what all consumers have in common.

Channels' own loop makes a task and a thread hop for each message, 0.3 ms; on the way of the stick that is most of
the time. This one hands each message straight to `heard`, and what takes long is done beside it.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from typing import Any

from channels.consumer import AsyncConsumer

from robots.bridge.server.flood_limits import Budget
from robots.wire import (
    Accepted,
    BrowserReport,
    FleetReport,
    Refusal,
    Refused,
    TopicsReport,
    WireError,
    encode,
    heading,
)
from teleop.recording import refusals
from teleop.recording.refusals import RefusedRequest

log = logging.getLogger(__name__)

FLOOD_PER_S = 200.0  # messages; a stick sends 30
FLOOD_BURST = 400.0  # what a stall of some seconds may leave behind
FLOOD_CLOSES_AFTER = 400  # refused messages
REPLIES_PER_S = 10.0  # refusals that are answered; the others are only counted
REPLIES_BURST = 20.0


_HEAR_NOW = "fleet.hear_now"  # the server's (`fleet.server.websocket`)


class CloseCode:
    """Why the server closes a WebSocket, for the page to act on."""

    SIGNED_OUT = 4401
    NOT_PERMITTED = 4403
    NOT_FOUND = 4404
    FLOOD = 4429
    TRY_AGAIN = 4503


class MessageSocket(AsyncConsumer):
    """Base of the consumers. Subclasses say what happens when it opens, hears something, and closes."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()  # messages not carried out, by code
        self._budget = Budget(FLOOD_PER_S, FLOOD_BURST)
        self._replies = Budget(REPLIES_PER_S, REPLIES_BURST)
        self._closing = False
        self._idle = False
        self.heard_s = time.monotonic()  # when the page last said anything

    async def on_open(self) -> None:
        """The handshake is done."""

    async def on_message(self, raw: str) -> None:
        """A text message came in. Raises WireError if it is none of ours. Must not wait for anything slow."""
        raise NotImplementedError

    async def on_close(self) -> None:
        """The connection is gone."""

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """The ASGI application."""
        self.scope: Any = scope
        self.asgi_send = send
        await receive()  # websocket.connect
        await send({"type": "websocket.accept"})
        try:
            await self.on_open()
            if offer := scope.get("extensions", {}).get(_HEAR_NOW):
                offer(self._hear_now)
            while (event := await self._next(receive))["type"] != "websocket.disconnect":
                if not self._closing:
                    await self._received(event)
        finally:
            await self.on_close()
            if self.refused:
                log.info("%s: refused on this connection: %s", scope["path"], dict(self.refused))

    async def _next(self, receive: Any) -> Any:
        self._idle = True
        event = await receive()
        self._idle = False
        return event

    def _hear_now(self, raw: str) -> bool:
        if not self._idle or self._closing or not self.on_message_now(raw):
            return False
        self.heard_s = time.monotonic()
        return True

    def on_message_now(self, raw: str) -> bool:
        """A text message came in while nothing waits. False: it was not looked at, and comes to `heard` in its turn."""
        return False

    async def _received(self, event: dict[str, Any]) -> None:
        self.heard_s = time.monotonic()
        raw = event.get("text")
        try:
            if raw is None:
                raise WireError(Refusal("not_text", "Only text frames are taken.", "wire"))
            await self.on_message(raw)
        except WireError as error:
            of, seq = heading(raw or "")
            if await self.within_budget(of):
                await self.refuse(of, error.refusal, seq)

    async def send_message(self, message: BrowserReport | TopicsReport | FleetReport) -> None:
        """Send a message to the page."""
        await self.send_encoded(encode(message).decode())

    async def send_encoded(self, message: str) -> None:
        """Send what is encoded already."""
        if not self._closing:
            await self.asgi_send({"type": "websocket.send", "text": message})

    async def refuse(
        self, of: str, refusal: Refusal, seq: int | None = None, fence: int | None = None
    ) -> None:
        """Count a message that is not carried out, and say why, though not more often than anybody can read."""
        self._denied(of, refusal)
        if self._replies.spend(time.monotonic()):
            await self.send_message(Refused(of, refusal, seq, fence))

    async def answer(self, answer: Accepted | Refused) -> None:
        """Give an order its one answer."""
        if isinstance(answer, Refused):
            self._denied(answer.of, answer.refusal)
        await self.send_message(answer)

    def _denied(self, of: str, refusal: Refusal) -> None:
        self.refused[refusal.code] += 1
        denied = self.refused_request(of, refusal)
        if denied is not None:
            refusals.note(denied)

    def refused_request(self, of: str, refusal: Refusal) -> RefusedRequest | None:
        """What goes on record of a refusal; None: nobody is there to whom it happened."""
        raise NotImplementedError

    def spend(self) -> bool:
        """Count one thing that this connection says. False: it is more than it may."""
        return self._budget.spend(time.monotonic())

    async def within_budget(self, of: str) -> bool:
        """Whether this connection may say one thing more. Refuses if not, and closes when it goes on and on."""
        if self.spend():
            return True
        text = f"More than {FLOOD_PER_S:.0f} messages a second."
        flood = Refusal("flood", text, "wire", {"limit_per_s": FLOOD_PER_S})
        await self.refuse(of, flood)
        if self.refused["flood"] >= FLOOD_CLOSES_AFTER:
            await self.send_message(Refused(of, flood))
            await self.close(CloseCode.FLOOD, text)
        return False

    async def close(self, code: int, reason: str) -> None:
        """Close the connection; what still comes in is not looked at."""
        if not self._closing:
            self._closing = True
            await self.asgi_send({"type": "websocket.close", "code": code, "reason": reason})


async def no_such_address(scope: Any, receive: Any, send: Any) -> None:
    """The ASGI application at every address that is none: closes, so that a page gives up."""
    await receive()  # websocket.connect
    await send({"type": "websocket.accept"})
    await send(
        {"type": "websocket.close", "code": CloseCode.NOT_FOUND, "reason": "There is no such address."}
    )
