"""A hub: one robot and everybody who has its page open in this web process.

It holds the link, hands out the pictures and looks at the database for all of them together: every half second
for those who have control or look closely, else every two. A stale look changes nothing for the better: who may
control is confirmed again and again, and whoever is not confirmed is not renewed at the bridge.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from datetime import timedelta
from typing import Protocol
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone

from robots.link.client import BridgeLink, links
from robots.wire import Ended, Offers, Refresh, Refusal, Refused, State
from teleop.background.database import in_database
from teleop.control import rules
from teleop.control.lease_events import LeaseEvents
from teleop.control.rules import Phase
from teleop.control.selectors import SignIn, control_status, robot_entry
from teleop.control.services import ControlRefused, lease_expire, lease_seen
from teleop.control.status import ControlStatus, RobotEntry
from teleop.live.picture_feed import PictureFeed
from teleop.live.topic_feed import TopicFeed

log = logging.getLogger(__name__)

LINK_TRY_S = 5.0  # on a computer that has much else to do, to open a link takes a while
LINK_WAIT_S = 0.5
LOOK_S = 0.5
REFRESH_S = 1.0  # the robot is asked at most so often what it offers
LOOKS_PER_FULL = 4  # everybody's rights and the registry: every so many looks


class Member(Protocol):
    """One page, as its hub sees it."""

    id: str
    person: SignIn
    name: str
    looks: bool  # pictures are wanted
    heard_s: float  # when the page last said anything, by the monotonic clock

    @property
    def held_session(self) -> UUID | None:
        """The control session that this page has."""

    @property
    def closely(self) -> bool:
        """Whether this person's rights are looked at each time."""

    async def stands(self, status: ControlStatus) -> None:
        """How control stands now."""

    async def edited(self, entry: RobotEntry) -> None:
        """What the registry says of the robot, at each full look."""

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """The link to the bridge came or went."""

    def offered(self, offers: Offers) -> None:
        """The robot offers something else."""

    def ended_at_bridge(self, ended: Ended) -> None:
        """The bridge ended somebody's control."""

    def refused_at_bridge(self, refused: Refused) -> None:
        """The bridge refused somebody's message."""


class RobotHub:
    """See the module. Made by `join`, gone with its last member."""

    def __init__(self, robot_id: UUID, entry: RobotEntry) -> None:
        self.robot_id = robot_id
        self.entry = entry
        self.link: BridgeLink = links.get(robot_id, entry.link)
        self.views = PictureFeed()
        self.topics = TopicFeed(self._look_at)
        self.members: dict[str, Member] = {}
        self.link_is_up = asyncio.Event()
        self._refreshed_s = float("-inf")
        self.looked_s = time.monotonic()  # when the rights of all who have control were last looked up
        self._one_look = asyncio.Lock()
        self._lease_events = LeaseEvents(robot_id, self.look)
        self._looking = asyncio.create_task(self._keep_looking())
        self.link.subscribe(self)

    # --- members -----------------------------------------------------------------------------------

    def add(self, member: Member) -> None:
        """Let a page in."""
        self.members[member.id] = member
        self.watchers_changed()

    async def remove(self, member: Member) -> None:
        """See a page out; the last one closes the hub."""
        self.members.pop(member.id, None)
        if self.members:
            self.watchers_changed()
            return
        _hubs.pop(self.robot_id, None)
        self._looking.cancel()  # first: it might follow another link yet
        with suppress(asyncio.CancelledError):
            await self._looking
        self.link.unsubscribe(self)
        await self._lease_events.close()
        await self.views.close()

    def watchers_changed(self) -> None:
        """Tell the bridge who looks."""
        self.link.watch(self, {member.name for member in self.members.values() if member.looks})

    def refresh(self, member: Member) -> Refusal | None:
        """Have the robot read again what it offers; if it has just done so, `member` is told. Returns why not."""
        if not self.link.up:
            return self.link.refusal
        now_s = time.monotonic()
        if now_s - self._refreshed_s >= REFRESH_S:
            self._refreshed_s = now_s
            self.link.send(Refresh())
        elif self.link.offers:
            member.offered(self.link.offers)
        return None

    def _look_at(self, topics: Mapping[str, float]) -> None:
        """Tell the bridge whose messages are looked at."""
        self.link.look_at(self, topics)

    async def link_settles(self) -> None:
        """Wait for a link that is just being made, and a moment for a bridge that could not be reached."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self.link.tried.wait(), LINK_TRY_S)
            await asyncio.wait_for(self.link_is_up.wait(), LINK_WAIT_S)

    # --- the database ------------------------------------------------------------------------------

    async def changed(self) -> None:
        """This process changed the lease: everybody is told, here and elsewhere.

        What is done is done: who cannot be told now finds out at a later look.
        """
        await self._lease_events.publish()
        try:
            await self.look()
        except DatabaseError as error:
            log.warning("a change of who has robot %s is not told yet: %s", self.robot_id, error)

    async def look(self) -> None:
        """Read how control stands, for everybody here. On return, they know what was true when this was called."""
        await self._look([member.person for member in self.members.values()])

    async def look_for(self, member: Member) -> None:
        """Read how control stands, for one who has just come."""
        await self._look([member.person])

    async def _look(self, people: Collection[SignIn]) -> None:
        # One after the other: what members are told never goes back in time.
        async with self._one_look:
            status, looked_s = await in_database(self._read, people)
            if self._holders.issubset(people):
                self.looked_s = looked_s
            for member in list(self.members.values()):
                try:
                    await member.stands(status)
                except Exception:  # one page's fault is not the others'
                    log.exception("a page of robot %s was not told how control stands", self.robot_id)

    @property
    def _holders(self) -> set[SignIn]:
        return {member.person for member in self.members.values() if member.held_session}

    def _read(self, people: Collection[SignIn]) -> tuple[ControlStatus, float]:
        """How control stands, and since when by the monotonic clock that is known: an answer may be long on its way."""
        looked_s = time.monotonic()
        sessions = [member.held_session for member in list(self.members.values()) if member.held_session]
        status = control_status(self.robot_id, people=people, sessions=sessions, now=timezone.now())
        if rules.phase(status.lease, status.read_at) is not Phase.LAPSED:
            return status, looked_s
        # It is over by the clock, even if nothing can be written; or somebody else expires it, or it came back.
        with suppress(ControlRefused, DatabaseError):
            self._note_seen()
            lease_expire(robot_id=self.robot_id, now=status.read_at)
        status = control_status(self.robot_id, people=people, sessions=sessions, now=timezone.now())
        return status, looked_s

    def _note_seen(self) -> None:
        """The holder's page was there when it last spoke; it pings, and a cut network looks like an open connection."""
        for member in list(self.members.values()):
            if session := member.held_session:
                silent = timedelta(seconds=time.monotonic() - member.heard_s)
                lease_seen(
                    robot_id=self.robot_id,
                    session=session,
                    connection=member.id,
                    seen_at=timezone.now() - silent,
                )

    async def _keep_looking(self) -> None:
        looks = 0
        reachable = True
        while True:
            await asyncio.sleep(LOOK_S)
            looks += 1
            try:
                await self._regular_look(full=looks % LOOKS_PER_FULL == 0)
                if not reachable:
                    log.info("the database answers again")
                reachable = True
            except DatabaseError as error:
                if reachable:
                    log.error("rights cannot be checked, so control is not renewed: %s", error)
                reachable = False
            except Exception:
                log.exception("a look at the lease failed")

    async def _regular_look(self, *, full: bool) -> None:
        closely = [member.person for member in self.members.values() if member.closely]
        if not full:
            if closely:
                await self._look(closely)
            return
        await self._read_registry()
        await self.look()
        if any(member.held_session for member in self.members.values()):
            await in_database(self._note_seen)

    async def _read_registry(self) -> None:
        entry = await in_database(robot_entry, self.robot_id)
        if entry is None or entry == self.entry:
            return
        self.entry = entry
        link = links.get(self.robot_id, entry.link)
        if link is not self.link:
            self.link.unsubscribe(self)
            self.link = link
            self.link.subscribe(self)
            self.watchers_changed()
            self._look_at(self.topics.wanted)
        for member in list(self.members.values()):
            await member.edited(entry)

    # --- the link (robots.link.client.Listener) -------------------------------------------------------------

    def on_view(self, raw: str) -> None:
        """A picture for all who look."""
        self.views.publish(raw)

    def on_status(self, state: State) -> None:
        """Pages see the state in their pictures."""

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        """Pages say so."""
        if up:
            self.link_is_up.set()
        else:
            self.link_is_up.clear()
            self.topics.forget()
        for member in list(self.members.values()):
            member.link_changed(up, refusal)

    def on_offers(self, offers: Offers) -> None:
        """For every page."""
        for member in list(self.members.values()):
            member.offered(offers)

    def on_seen(self, topic: str, shown: str) -> None:
        """A message for all who look at its topic."""
        self.topics.publish(topic, shown)

    def on_ended(self, ended: Ended) -> None:
        """For whoever held it."""
        for member in list(self.members.values()):
            member.ended_at_bridge(ended)

    def on_refused(self, refused: Refused) -> None:
        """For whoever sent it."""
        for member in list(self.members.values()):
            member.refused_at_bridge(refused)


_hubs: dict[UUID, RobotHub] = {}


def join(robot_id: UUID, entry: RobotEntry, member: Member) -> RobotHub:
    """The robot's hub, with `member` in it."""
    hub = _hubs.get(robot_id)
    if hub is None:
        hub = _hubs[robot_id] = RobotHub(robot_id, entry)
    hub.add(member)
    return hub
