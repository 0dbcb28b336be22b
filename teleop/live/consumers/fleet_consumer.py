"""The WebSocket of the fleet page: a card for each robot that its person may see."""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections.abc import Collection, Iterable
from functools import partial
from uuid import UUID

from django.db import DatabaseError
from msgspec import Raw, Struct, structs

from robots.link.client import BridgeLink
from robots.shared import wire
from robots.shared.wire import NotDone, Refusal, Refused, fleet_message
from teleop.background.jobs import run_in_background
from teleop.control.changes import database_refusal
from teleop.control.selectors import SIGNED_OUT, SignIn
from teleop.live.consumers.message_socket import BUSY, CloseCode, MessageSocket
from teleop.live.fleet.board import FleetPage, board
from teleop.live.fleet.cards import RobotCard
from teleop.live.fleet.sights import Own, Sight
from teleop.records.refusals import RefusedRequest
from teleop.stop.emergency_stop import StopButton, clear

log = logging.getLogger(__name__)

SLOW_S = 1.0  # between two updates when no important value changed
FAST_S = 0.1  # between two messages, also when one changed
SPREAD_S = 0.0002  # for each page: the loop must not send to hundreds of pages in one turn

_BEAT = wire.encode(wire.Beat()).decode()
_UNKNOWN = Refusal("no_such_robot", "There is no such robot, or you may not see it.", "account")
_NONE = Refusal("no_such_robot", "There is no robot in service that you may stop.", "account")


class _EncodedFleet(Struct, frozen=True, tag_field="t", tag="fleet"):
    """`wire.Fleet` with encoded cards."""

    robots: dict[str, Raw]
    changed: bool


class FleetConsumer(MessageSocket, FleetPage):
    """One fleet page. It gets what changed after it acknowledged the previous update; updates are never queued."""

    through = "fleet page"

    def __init__(self) -> None:
        super().__init__()
        self._robots: dict[str, tuple[RobotCard, Own]] = {}
        self._shown: dict[str, tuple[int, Own]] | None = None  # version of each card; None: nothing was sent
        self._acknowledged = False  # nothing is sent before the page follows what its person may see
        self._is_new = self._is_urgent = True  # what the cards show; some of it should be seen at once
        self._shown_s = self._sent_s = float("-inf")
        self._alarm: asyncio.TimerHandle | None = None  # of an urgent update
        self._place = random.random()  # noqa: S311 - among the pages that hear of something at the same time
        self._buttons: dict[str, StopButton] = {}
        self._clearing: set[str] = set()  # robots with a running clear

    # --- opening and closing -----------------------------------------------------------------------

    async def on_open(self) -> None:
        """Show the robots, and keep them up to date."""
        self.person: SignIn = (UUID(str(self.scope["user"].pk)), self.scope["session"].session_key or "")
        await board.join(self)
        self._acknowledged = True
        await self.beat()

    async def on_close(self) -> None:
        board.leave(self)
        if self._alarm is not None:
            self._alarm.cancel()

    # --- messages ----------------------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        """Act on one message. A stop waits for nothing."""
        match fleet_message(raw):
            case wire.StopAll():
                if slugs := [slug for slug, (card, _) in self._robots.items() if card.robot.enabled]:
                    self._press_stop(slugs)
                elif await self.within_budget("stop"):
                    await self.send_refusal("stop", _NONE)
            case wire.StopRobot(slug=slug) if slug in self._robots:
                self._press_stop([slug])
            case wire.StopRobot():
                if await self.within_budget("stop"):
                    await self.send_refusal("stop", _UNKNOWN)
            case wire.ClearRobot(slug=slug, number=number):
                if await self.within_budget("clear"):
                    await self._clear_in_background(slug, number)
            case wire.Ack():
                if await self.within_budget("ack"):
                    self._acknowledged = True
                    self._ring()
            case wire.Ping(sent_ms=sent_ms):
                if await self.within_budget("ping"):
                    await self.send_message(wire.Pong(sent_ms))

    def _link(self, slug: str) -> BridgeLink:
        return self._robots[slug][0].link

    def _press_stop(self, slugs: Iterable[str]) -> None:
        flood = not self.spend()  # counts for the flood limit, but is never refused
        for slug in slugs:
            button = self._buttons.get(slug)
            if button is None:
                not_stopped = partial(self._not_stopped, slug)
                button = self._buttons[slug] = StopButton(self.user, self.through, not_stopped)
            button.press(self._link(slug), flood=flood)

    async def _not_stopped(self, slug: str, refusal: Refusal) -> None:
        """Always name the robot: after "Stop all" the person must know which robot may still move."""
        await self.answer(Refused("stop", _with_slug(refusal, slug)))

    async def _clear_in_background(self, slug: str, number: int) -> None:
        """Check, record and send a clear, for each robot in parallel."""
        if slug not in self._robots:
            await self._not_cleared(slug, _UNKNOWN)
        elif slug in self._clearing:
            await self._not_cleared(slug, BUSY)
        else:
            self._clearing.add(slug)
            run_in_background(self._clear(slug, self._link(slug), number))

    async def _clear(self, slug: str, link: BridgeLink, number: int) -> None:
        try:
            await clear(link, number, user=self.user, tab=None)
        except NotDone as refused:
            await self._not_cleared(slug, refused.refusal)
        except DatabaseError as error:
            await self._not_cleared(slug, database_refusal(error))
        finally:
            self._clearing.discard(slug)

    async def _not_cleared(self, slug: str, refusal: Refusal) -> None:
        await self.answer(Refused("clear", _with_slug(refusal, slug)))

    def refused_request(self, of: str, refusal: Refusal) -> RefusedRequest:
        """Return the refusal with the person only: the record of a stop contains the robot."""
        return RefusedRequest(self.user, self.through, of, refusal)

    # --- what the person may see (teleop.live.fleet.board.FleetPage) ---------------------------------------

    @property
    def cards(self) -> Collection[RobotCard]:
        return [card for card, _ in self._robots.values()]

    async def follow(self, sight: Sight | None) -> None:
        if sight is None:
            await self.close(CloseCode.SIGNED_OUT, SIGNED_OUT.text)
            return
        self.user = sight.user
        cards = ((board.card(robot), own) for robot, own in sight.robots.items())
        robots = {card.robot.slug: (card, own) for card, own in cards}
        self._is_new |= robots != self._robots
        self._robots = robots

    def card_changed(self, urgent: bool) -> None:
        self._is_new = True
        if urgent and not self._is_urgent:
            self._is_urgent = True
            self._ring()

    # --- updates -----------------------------------------------------------------------------------

    async def beat(self) -> None:
        if self._alarm is not None:  # something urgent follows soon
            return
        try:
            await self._show()
        except Exception:
            self._acknowledged = self._is_new = True
            self._shown, self._shown_s = None, self._sent_s
            log.exception("A fleet page was not updated.")

    async def _show(self) -> None:
        """Send what changed, if it is due; else that nothing changed."""
        if not self._acknowledged:
            return
        self._sent_s = time.monotonic()
        if self._is_urgent or (self._is_new and self._sent_s - self._shown_s >= SLOW_S):
            self._is_new = self._is_urgent = False
            if (update := self._update()) is not None:
                self._acknowledged = False
                self._shown_s = self._sent_s
                await self.send_encoded(wire.encode(update).decode())
                return
        await self.send_encoded(_BEAT)

    def _update(self) -> _EncodedFleet | None:
        """Return the cards that are new to the page; None: there are none."""
        shown = {slug: (card.version, own) for slug, (card, own) in self._robots.items()}
        before = self._shown
        is_first = before is None or before.keys() != shown.keys()
        new = [slug for slug in shown if before is None or is_first or before[slug] != shown[slug]]
        cards = {slug: Raw(card.encoded(own)) for slug, (card, own) in self._robots.items() if slug in new}
        self._shown = shown
        return _EncodedFleet(cards, changed=not is_first) if cards or is_first else None

    def _ring(self) -> None:
        """Send soon, at the earliest `FAST_S` after the last message."""
        if self._is_urgent and self._acknowledged and self._alarm is None:
            wait_s = max(0.0, self._sent_s + FAST_S - time.monotonic())
            wait_s += self._place * min(FAST_S, SPREAD_S * len(board.pages))
            self._alarm = asyncio.get_running_loop().call_later(wait_s, self._wake)

    def _wake(self) -> None:
        self._alarm = None
        run_in_background(self.beat())


def _with_slug(refusal: Refusal, slug: str) -> Refusal:
    return structs.replace(refusal, figures={**refusal.figures, "slug": slug})
