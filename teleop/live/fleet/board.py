"""All fleet pages of this web process: one reader of rights and one card of each robot, for all of them."""

from __future__ import annotations

import asyncio
import logging
import time
from abc import abstractmethod
from collections.abc import Collection
from typing import Protocol
from uuid import UUID

from django.db import DatabaseError

from robots.registry.stored_robots import StoredRobots
from robots.shared.processes.in_step import next_step
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control.selectors import SignIn
from teleop.live.fleet.cards import RobotCard
from teleop.live.fleet.sights import FleetRobot, Sight, sights_of

log = logging.getLogger(__name__)

RIGHTS_S = 2.0
LOOK_S = 0.5  # between two looks at what changes by time alone
BEAT_S = 0.2  # between two messages to a page: it looks old after 0.5 s without one
PAGES_IN_A_TURN = 10  # of the loop: it must not send to hundreds of pages in one


class FleetPage(Protocol):
    """A page of the board."""

    person: SignIn

    @property
    @abstractmethod
    def cards(self) -> Collection[RobotCard]:
        """Return the cards that it shows."""

    @abstractmethod
    async def follow(self, sight: Sight | None) -> None:
        """Follow what its person may see now; None: the sign-in ended."""

    @abstractmethod
    def card_changed(self, urgent: bool) -> None:
        """Note that a card is new, perhaps one that it does not show."""

    @abstractmethod
    async def beat(self) -> None:
        """Send what is new, or that nothing is."""


class Board:
    """Works while a page is open."""

    def __init__(self) -> None:
        self.pages: set[FleetPage] = set()
        self._cards: dict[UUID, RobotCard] = {}
        self._unused: set[RobotCard] = set()
        self._stored = StoredRobots()
        self._asked: set[SignIn] = set()
        self._next_read: asyncio.Task[dict[SignIn, Sight]] | None = None
        self._reading: asyncio.Lock | None = None
        self._loops: list[asyncio.Task[None]] = []

    async def join(self, page: FleetPage) -> None:
        """Add a page; it follows its first sight before this returns."""
        if not self.pages:
            self._reading, self._next_read, self._asked = asyncio.Lock(), None, set()
            loops = self._keep_reading(), self._keep_looking(), self._keep_beating()
            self._loops = [run_in_background(loop) for loop in loops]
        self.pages.add(page)
        await page.follow((await self._sights({page.person})).get(page.person))

    def leave(self, page: FleetPage) -> None:
        """Remove a page."""
        self.pages.discard(page)
        if not self.pages:
            for loop in self._loops:
                loop.cancel()
            self._drop(set(self._cards.values()))

    def card(self, robot: UUID) -> RobotCard:
        """Return the card of a robot that somebody may see."""
        return self._cards[robot]

    # --- reading -----------------------------------------------------------------------------------

    async def _sights(self, people: Collection[SignIn]) -> dict[SignIn, Sight]:
        """Read what these sign-ins may see. All that ask before a read begins share it."""
        self._asked.update(people)
        if self._next_read is None:
            self._next_read = asyncio.create_task(self._read())
        # Others wait for it, too, if this page is closed.
        return await asyncio.shield(self._next_read)

    async def _read(self) -> dict[SignIn, Sight]:
        assert self._reading is not None  # noqa: S101 - a page is open
        async with self._reading:
            people, self._asked, self._next_read = self._asked, set(), None
            robots, sights = await in_database(sights_of, people, self._stored)
        for robot in robots if self.pages else ():  # the last page may be gone
            self._show(robot)
        return sights

    def _show(self, robot: FleetRobot) -> None:
        if robot.id in self._cards:
            self._cards[robot.id].follow(robot)
        else:
            self._cards[robot.id] = RobotCard(robot, self._card_changed)

    async def _keep_reading(self) -> None:
        while True:
            await asyncio.sleep(RIGHTS_S)
            pages = list(self.pages)
            try:
                sights = await self._sights({page.person for page in pages})
                for page in pages:
                    await _follow(page, sights.get(page.person))
            except DatabaseError as error:
                log.warning("The robots of the fleet pages could not be read: %s", error)
            except Exception:
                log.exception("Reading the robots of the fleet pages failed.")
            else:
                self._drop_unused()

    def _drop_unused(self) -> None:
        """Drop the cards that no page has shown for a whole round: a page that opens now has not followed yet."""
        unused = set(self._cards.values()) - {card for page in self.pages for card in page.cards}
        self._drop(unused & self._unused)
        self._unused = unused

    def _drop(self, cards: Collection[RobotCard]) -> None:
        for card in cards:
            del self._cards[card.robot.id]
            card.close()

    # --- cards -------------------------------------------------------------------------------------

    async def _keep_looking(self) -> None:
        while True:
            await _step(LOOK_S)
            for card in list(self._cards.values()):
                card.look()

    async def _keep_beating(self) -> None:
        """Beat for all pages: a timer and a task of each page would cost more than what they send."""
        while True:
            await _step(BEAT_S)
            for number, page in enumerate(list(self.pages), 1):
                if page in self.pages:
                    await page.beat()
                if number % PAGES_IN_A_TURN == 0:
                    await asyncio.sleep(0)

    def _card_changed(self, urgent: bool) -> None:
        for page in self.pages:
            page.card_changed(urgent)


async def _step(pace_s: float) -> None:
    now_s = time.monotonic()
    await asyncio.sleep(next_step(now_s, pace_s) - now_s)


async def _follow(page: FleetPage, sight: Sight | None) -> None:
    """Let a page follow; a fault of one page must not affect the others."""
    try:
        await page.follow(sight)
    except Exception:
        log.exception("A fleet page could not follow what its person may see.")


board = Board()
