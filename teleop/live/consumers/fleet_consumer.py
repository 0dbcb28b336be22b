"""The WebSocket of the fleet page: a card for each robot that its person may see."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone
from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.accounts.selectors import signed_in
from fleet.bookings.lessons.present import InLine, line_of_turns
from fleet.bookings.schedule import Schedule, schedules_of
from robots.access.selectors import robots_visible_to, roles_of
from robots.link.client import BridgeLink, Listener, links
from robots.registry.models import Role
from robots.registry.selectors import link_address
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import FleetCard, NotDone, Refusal, Refused, State, fleet_message
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control.changes import database_refusal
from teleop.control.rules import out_now, out_of_service
from teleop.control.selectors import SIGNED_OUT, SignIn
from teleop.control.status import booked_slots, turn_of
from teleop.live.consumers.message_socket import BUSY, CloseCode, MessageSocket
from teleop.records.refusals import RefusedRequest
from teleop.stop.emergency_stop import StopButton, clear

log = logging.getLogger(__name__)

RIGHTS_S = 2.0
SHARED_S = 0.5  # so long all fleet pages of one sign-in share what was read
SLOW_S = 1.0  # between two updates when no important value changed
FAST_S = 0.1  # between two updates when one changed
BEAT_S = 0.2  # between two messages of any kind: pages look old after 0.5 s without one

_BEAT = wire.Beat()
_SILENT = Refusal(
    "bridge_silent", "The robot’s bridge does not answer: it or its computer is busy or frozen.", "robot"
)
_UNKNOWN = Refusal("no_such_robot", "There is no such robot, or you may not see it.", "account")
_NONE = Refusal("no_such_robot", "There is no robot in service that you may stop.", "account")


class VisibleRobot(Struct, frozen=True):
    """A robot that the person may see."""

    id: UUID
    slug: str
    enabled: bool
    refusal: Refusal | None  # why it cannot be driven now
    out: Refusal | None  # why nobody can book it now
    link: LinkAddress
    may_clear: bool
    schedule: Schedule  # its bookings
    line: tuple[InLine, ...]  # of the lesson that runs now
    user: UUID  # the page's person


class _Sights:
    """The robots that sign-ins may see: read once for all fleet pages of a sign-in, so that hundreds cost as few do."""

    def __init__(self) -> None:
        self._read: dict[SignIn, tuple[float, asyncio.Task[Iterable[VisibleRobot] | None]]] = {}

    async def of(self, person: SignIn) -> Iterable[VisibleRobot] | None:
        """Return the robots that this sign-in may see; None if it ended."""
        now_s = time.monotonic()
        self._read = {
            one: (began_s, reading)
            for one, (began_s, reading) in self._read.items()
            if not reading.done() or now_s - began_s < SHARED_S
        }
        if person not in self._read:
            self._read[person] = now_s, asyncio.ensure_future(in_database(_visible_to, person))
        # Others wait for it, too, if this page is closed.
        return await asyncio.shield(self._read[person][1])


_sights = _Sights()


class FleetConsumer(MessageSocket, Listener):
    """One fleet page. It gets the newest update after it acknowledged the previous one; updates are never queued."""

    through = "fleet page"

    def __init__(self) -> None:
        super().__init__()
        self._robots: dict[str, VisibleRobot] = {}
        self._links: dict[str, BridgeLink] = {}
        self._acknowledged = True
        self._changed = asyncio.Event()
        self._shown_key: list[object] = []
        self._buttons: dict[str, StopButton] = {}
        self._clearing: set[str] = set()  # robots with a running clear
        self._loops: list[asyncio.Task[None]] = []

    # --- opening and closing -----------------------------------------------------------------------

    async def on_open(self) -> None:
        """Show the robots, and keep them up to date."""
        self.person: SignIn = (UUID(str(self.scope["user"].pk)), self.scope["session"].session_key or "")
        self.user = await in_database(_person, self.person)
        await self._read_robots()
        self._loops = [run_in_background(self._keep_reading()), run_in_background(self._keep_showing())]

    async def on_close(self) -> None:
        for loop in self._loops:
            loop.cancel()
        for link in self._links.values():
            link.unsubscribe(self)

    # --- messages ----------------------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        """Act on one message. A stop waits for nothing."""
        match fleet_message(raw):
            case wire.StopAll():
                if slugs := [robot.slug for robot in self._robots.values() if robot.enabled]:
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
                    self._wake()
            case wire.Ping(sent_ms=sent_ms):
                if await self.within_budget("ping"):
                    await self.send_message(wire.Pong(sent_ms))

    def _press_stop(self, slugs: Iterable[str]) -> None:
        flood = not self.spend()  # counts for the flood limit, but is never refused
        for slug in slugs:
            button = self._buttons.get(slug)
            if button is None:
                not_stopped = partial(self._not_stopped, slug)
                button = self._buttons[slug] = StopButton(self.user, self.through, not_stopped)
            button.press(self._links[slug], flood=flood)

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
            run_in_background(self._clear(slug, self._links[slug], number))

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

    # --- updates -----------------------------------------------------------------------------------

    async def _keep_showing(self) -> None:
        shown_s = -SLOW_S
        while True:
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._changed.wait(), BEAT_S - FAST_S)
            is_due = self._changed.is_set() or time.monotonic() - shown_s >= SLOW_S
            self._changed.clear()
            if self._acknowledged and not is_due:
                await self.send_message(_BEAT)
            elif self._acknowledged:
                self._acknowledged = False
                shown_s = time.monotonic()
                self._shown_key = self._change_key()
                try:
                    await self.send_message(wire.Fleet({slug: self._card(slug) for slug in self._robots}))
                except Exception:
                    self._acknowledged = True
                    log.exception("A fleet page was not updated.")
            await asyncio.sleep(FAST_S)

    def _card(self, slug: str) -> FleetCard:
        link, robot = self._links[slug], self._robots[slug]
        known = link.up and not link.silent
        refusal = None if known else robot.refusal or link.refusal or _SILENT
        state = link.state if known else None
        now = timezone.now()
        booked, next_booked = booked_slots(robot.schedule, robot.user, now)
        if booked and robot.schedule.current:
            booked = structs.replace(booked, turn=turn_of(robot.schedule.current, robot.line, now))
        free_from = robot.schedule.free_from(now) if robot.enabled else None
        free_in_s = None if free_from is None else round((free_from - now).total_seconds(), 1)
        return FleetCard(
            state,
            refusal,
            link.seen_at,
            robot.may_clear,
            link.pending,
            booked,
            next_booked,
            free_in_s,
            robot.out,
        )

    def _wake(self) -> None:
        if self._acknowledged and self._change_key() != self._shown_key:
            self._changed.set()

    def _change_key(self) -> list[object]:
        """Return the values whose change people want to see at once."""
        return [
            (
                link.up,
                link.silent,
                link.pending,
                state and (state.phase, _is_silent(state), state.holder, state.stop, state.verdict.code),
            )
            for link in self._links.values()
            for state in (link.state,)
        ]

    # --- visible robots ----------------------------------------------------------------------------

    async def _keep_reading(self) -> None:
        while True:
            await asyncio.sleep(RIGHTS_S)
            try:
                await self._read_robots()
            except DatabaseError as error:
                log.warning("The robots of a fleet page could not be read: %s", error)
            except Exception:
                log.exception("Reading the robots of a fleet page failed.")

    async def _read_robots(self) -> None:
        """Subscribe to the robots that this person may see now."""
        visible = await _sights.of(self.person)
        if visible is None:
            await self.close(CloseCode.SIGNED_OUT, SIGNED_OUT.text)
            return
        self._robots = {robot.slug: robot for robot in visible}
        wanted = {robot.slug: links.get(robot.id, robot.link) for robot in visible}
        for slug, link in self._links.items():
            if wanted.get(slug) is not link:
                link.unsubscribe(self)
        fresh = [link for slug, link in wanted.items() if self._links.get(slug) is not link]
        self._links = wanted
        for link in fresh:
            link.subscribe(self)

    # --- events of the links (robots.link.client.Listener) --------------------------------------------------

    def on_status(self, state: State) -> None:
        self._wake()

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        self._wake()


def _is_silent(state: wire.State) -> bool:
    return state.unseen_s is not None and state.unseen_s >= wire.SILENT_S


def _with_slug(refusal: Refusal, slug: str) -> Refusal:
    return structs.replace(refusal, figures={**refusal.figures, "slug": slug})


def _person(person: SignIn) -> User:
    return User.objects.get(pk=person[0])


def _line_of(schedule: Schedule) -> tuple[InLine, ...]:
    current = schedule.current
    return line_of_turns(current.id) if current is not None and current.turn_min else ()


def _visible_to(person: SignIn) -> Iterable[VisibleRobot] | None:
    """Return the robots that this sign-in may see; None if it ended."""
    user = signed_in([person]).get(person)
    if user is None:
        return None
    robots = list(robots_visible_to(user))
    roles = roles_of(user, robots)
    now = timezone.now()
    schedules = schedules_of(robots, now)
    return [
        VisibleRobot(
            robot.id,
            robot.slug,
            robot.enabled,
            out_of_service(robot),
            out_now(robot, schedules[robot.id], user, now),
            link_address(robot),
            may_clear=roles.get(robot.id, Role.OBSERVER) >= Role.SUPERVISOR,
            schedule=schedules[robot.id],
            line=_line_of(schedules[robot.id]),
            user=user.id,
        )
        for robot in robots
    ]
