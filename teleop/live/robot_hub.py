"""The hub of one robot: its link, its feeds, and all its connections in this web process.

The hub reads the database for all connections together: every 0.5 s for the holder of control and for
connections with `checked_often`, every 2 s for all. Control is renewed at the bridge only while these reads
confirm the rights of the holder. So an old read never makes control longer. A read also stores the ends of
leases and the offers that are due.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import defaultdict
from collections.abc import Collection, Mapping
from concurrent.futures import Future
from contextlib import suppress
from datetime import timedelta
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone

from robots.link.client import BridgeLink, Listener, links
from robots.shared.processes.durations import Durations
from robots.shared.wire import Ended, GoPath, Offers, Refresh, Refusal, Refused
from teleop.background.database import in_database, in_database_background
from teleop.control import lease_checks
from teleop.control.changes import ControlRefused
from teleop.control.database_watch import DatabaseWatch
from teleop.control.lease_checks import Phase
from teleop.control.lease_events import LeaseEvents
from teleop.control.selectors import SignIn, control_status, robot_entry, who_sees
from teleop.control.services import lease_expire, lease_fit_slot, lease_store_seen
from teleop.control.status import ControlStatus, RobotEntry
from teleop.control.waiting import line
from teleop.control.waiting.turns import settle_or_log
from teleop.live.topic_feed import TopicFeed
from teleop.live.view_feed import ViewFeed

log = logging.getLogger(__name__)

LINK_TRY_S = 5.0  # a busy computer needs a while to open a link
LINK_WAIT_S = 0.5
STATUS_S = 0.5
REFRESH_S = 1.0  # shortest time between two requests to read the robot's capabilities again
FULL_EVERY = 4  # one read out of this many covers everybody's rights and the registry


class Member:
    """One connection to the robot: a page, or a program. It has no control, and ignores events."""

    id: str
    person: SignIn
    name: str
    wants_views: bool
    draws_joints: bool  # the page draws the robot's joints in 3D
    heard_s: float  # monotonic time of its last message

    @property
    def held_session(self) -> UUID | None:
        """Return the control session of this connection; None without control."""
        return None

    @property
    def waits(self) -> bool:
        """Return whether this connection waits in line for control."""
        return False

    @property
    def checked_often(self) -> bool:
        """Return whether the person's rights are read every time, not only at full reads."""
        return self.held_session is not None or self.waits

    async def follow(self, status: ControlStatus) -> None:
        """Follow the status of control, which the hub has just read."""

    async def robot_edited(self, entry: RobotEntry) -> None:
        """The registry's entry of the robot changed."""

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """The link to the bridge came up or went down."""

    def offers_changed(self, offers: Offers) -> None:
        """The robot's capabilities changed."""

    def path_changed(self, path: GoPath) -> None:
        """The path of the robot's navigation changed."""

    def ended_at_bridge(self, ended: Ended) -> None:
        """The bridge ended control, of this or another member."""

    def refused_at_bridge(self, refused: Refused) -> None:
        """The bridge refused a message, of this or another member."""


class RobotHub(Listener):
    """The hub of one robot in this web process. `join` creates the hub; it ends with its last member."""

    def __init__(self, robot_id: UUID, entry: RobotEntry) -> None:
        self.robot_id = robot_id
        self.entry = entry
        self.link: BridgeLink = links.get(robot_id, entry.link)
        self.forward_durations = forward_durations[entry.facts.slug]
        self.views = ViewFeed()
        self.topics = TopicFeed(self._subscribe_topics)
        self.members: dict[str, Member] = {}
        self._storing: Future[None] | None = None  # the times of the pages
        self.link_is_up = asyncio.Event()
        self._refreshed_s = float("-inf")
        self.confirmed_s = time.monotonic()  # monotonic time when the holder's rights were last read
        self._reading = asyncio.Lock()
        self._database = DatabaseWatch()
        self._lease_events = LeaseEvents(robot_id, self.read_status)
        self._reader = asyncio.create_task(self._keep_reading())
        self.link.subscribe(self)

    # --- members -----------------------------------------------------------------------------------

    def add(self, member: Member) -> None:
        """Add a connection."""
        self.members[member.id] = member
        self.viewers_changed()

    async def remove(self, member: Member) -> None:
        """Remove a connection. The hub ends with its last connection."""
        self.members.pop(member.id, None)
        if self.members:
            self.viewers_changed()
            return
        _hubs.pop(self.robot_id, None)
        self._reader.cancel()  # cancel this first: it might still subscribe to another link
        with suppress(asyncio.CancelledError):
            await self._reader
        self.link.unsubscribe(self)
        await self._lease_events.close()
        await self.views.close()

    def viewers_changed(self) -> None:
        """Send the bridge the names of the viewers, and whether a viewer draws the robot's joints."""
        viewers = [member for member in self.members.values() if member.wants_views]
        self.link.set_viewers(
            self, {member.name for member in viewers}, any(member.draws_joints for member in viewers)
        )

    def refresh_offers(self, member: Member) -> Refusal | None:
        """Make the bridge read the robot's capabilities again. If it has just done so, send `member` the last result.

        Returns a refusal if the bridge is out of reach.
        """
        if not self.link.up:
            return self.link.refusal
        now_s = time.monotonic()
        if now_s - self._refreshed_s >= REFRESH_S:
            self._refreshed_s = now_s
            self.link.send(Refresh())
        elif self.link.offers:
            member.offers_changed(self.link.offers)
        return None

    def _subscribe_topics(self, topics: Mapping[str, float]) -> None:
        """Send the bridge the subscribed topics and their rates in Hz."""
        self.link.set_subscriptions(self, topics)

    async def wait_for_link(self) -> None:
        """Wait for a new link: at most `LINK_TRY_S` for its first try, then `LINK_WAIT_S` until it is up."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self.link.tried.wait(), LINK_TRY_S)
            await asyncio.wait_for(self.link_is_up.wait(), LINK_WAIT_S)

    # --- the database ------------------------------------------------------------------------------

    async def lease_changed(self) -> None:
        """Inform everybody, here and in other web processes, that this process changed the lease.

        The change is already stored: if this fails, the next regular read informs everybody.
        """
        await self._lease_events.publish()
        try:
            await self.read_status()
        except DatabaseError as error:
            log.warning("A change of control of robot %s is not shown yet: %s", self.robot_id, error)

    async def read_status(self) -> None:
        """Read the status of control for all members. The status is at least as new as this call."""
        await self._read_status([member.person for member in self.members.values()])

    async def read_status_for(self, member: Member) -> None:
        """Read the status of control for a new member."""
        await self._read_status([member.person])

    async def _read_status(self, people: Collection[SignIn], *, registry: bool = False) -> None:
        # One read after the other: members must never see an older status after a newer one.
        async with self._reading:
            entry, (status, confirmed_s) = await in_database(self._read_all, people, registry)
            if entry is not None and entry != self.entry:
                await self._follow_entry(entry)
            if self._holders.issubset(people):
                self.confirmed_s = confirmed_s
            for member in list(self.members.values()):
                try:
                    await member.follow(status)
                except Exception:  # a fault of one page must not affect the others
                    log.exception("A page of robot %s could not follow the status of control.", self.robot_id)

    @property
    def _holders(self) -> set[SignIn]:
        return {member.person for member in self.members.values() if member.held_session}

    def _read_all(
        self, people: Collection[SignIn], registry: bool
    ) -> tuple[RobotEntry | None, tuple[ControlStatus, float]]:
        """Read all with one database connection: opening a connection takes most of the time."""
        return robot_entry(self.robot_id) if registry else None, self._read_and_settle(people)

    def _read_and_settle(self, people: Collection[SignIn]) -> tuple[ControlStatus, float]:
        """Read the status; store ends of leases and offers that are due.

        Return the status, and the monotonic time before the read, because the read may take long.
        """
        confirmed_s = time.monotonic()
        sessions = [member.held_session for member in list(self.members.values()) if member.held_session]
        status = control_status(self.robot_id, people=people, sessions=sessions, now=timezone.now())
        self._database.answered()
        lease = status.lease
        if lease_checks.phase(lease, status.read_at) is not Phase.LAPSED:
            if lease is None:
                return (self._read_again(people, sessions) if self._offer(status) else status), confirmed_s
            until = status.moved_term_end()
            if until is None:
                return status, confirmed_s
            with suppress(ControlRefused, DatabaseError):
                lease_fit_slot(robot_id=self.robot_id, before=lease, until=until, now=status.read_at)
                if until <= status.read_at:  # another person's slot has begun: end control with this reason
                    lease_expire(robot_id=self.robot_id, now=timezone.now())
            return self._read_again(people, sessions), confirmed_s
        # The lease has lapsed, also if its end cannot be stored. `lease_expire` refuses if the page of the
        # holder has just come back, or if another process has stored the end already.
        with suppress(ControlRefused, DatabaseError):
            self._store_seen()
            if self._database.excuses(lease, status.read_at):
                return self._read_again(people, sessions), confirmed_s
            lease_expire(robot_id=self.robot_id, now=status.read_at)
        self._offer(status)
        return self._read_again(people, sessions), confirmed_s

    def _offer(self, status: ControlStatus) -> bool:
        """Offer the free robot to the next in line, or call the next of a lesson. Return whether that changed it."""
        if status.turns_due and settle_or_log(self.robot_id, status.read_at):
            return True
        if not status.line or lease_checks.offered(status.line, status.read_at) is not None:
            return False
        with suppress(ControlRefused, DatabaseError):
            return line.offer_next(robot_id=self.robot_id, now=status.read_at)
        return False

    def _read_again(self, people: Collection[SignIn], sessions: list[UUID]) -> ControlStatus:
        return control_status(self.robot_id, people=people, sessions=sessions, now=timezone.now())

    def _store_seen_later(self) -> None:
        """Store it in the background: rights are read meanwhile, also while somebody keeps the database locked."""
        if self._storing is None or self._storing.done():
            self._storing = in_database_background(self._store_seen)

    def _store_seen(self) -> None:
        """Store when the holder's page last sent a message, and which pages of waiting people are open.

        An open connection is no proof that the page is there: it looks open also while the network is cut.
        """
        for member in list(self.members.values()):
            if session := member.held_session:
                silent = timedelta(seconds=time.monotonic() - member.heard_s)
                lease_store_seen(
                    robot_id=self.robot_id,
                    session=session,
                    connection=member.id,
                    seen_at=timezone.now() - silent,
                )
        if waiting := [member.id for member in list(self.members.values()) if member.waits]:
            line.line_keep(robot_id=self.robot_id, connections=waiting, now=timezone.now())

    async def _keep_reading(self) -> None:
        reads = 0
        reachable = True
        while True:
            await asyncio.sleep(STATUS_S)
            reads += 1
            try:
                await self._read_regularly(full=reads % FULL_EVERY == 0)
                if not reachable:
                    log.info("The database answers again.")
                reachable = True
            except DatabaseError as error:
                if reachable:
                    log.error("Rights cannot be checked, so control is not renewed: %s", error)
                reachable = False
            except Exception:
                log.exception("Reading the status of control failed.")

    async def _read_regularly(self, *, full: bool) -> None:
        often = [member.person for member in self.members.values() if member.checked_often]
        if not full:
            if any(member.held_session or member.waits for member in self.members.values()):
                await self._read_status(often)
            elif often:
                await self._read_who_sees(often)
            return
        await self._read_status([member.person for member in self.members.values()], registry=True)
        if any(member.held_session or member.waits for member in self.members.values()):
            self._store_seen_later()

    async def _read_who_sees(self, people: Collection[SignIn]) -> None:
        """Read whether these people may still see the robot. Nobody has control, so the rest is read at a full read."""
        if not (await in_database(who_sees, people, self.robot_id)).issuperset(people):
            await self._read_status(people)

    async def _follow_entry(self, entry: RobotEntry) -> None:
        """Follow a change of the registry."""
        self.entry = entry
        link = links.get(self.robot_id, entry.link)
        if link is not self.link:
            self.link.unsubscribe(self)
            self.link = link
            self.link.subscribe(self)
            self.viewers_changed()
            self._subscribe_topics(self.topics.rates_hz)
        for member in list(self.members.values()):
            await member.robot_edited(entry)

    # --- the link (robots.link.client.Listener) -------------------------------------------------------------

    def on_view(self, raw: str) -> None:
        self.views.publish(raw)

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        if up:
            self.link_is_up.set()
        else:
            self.link_is_up.clear()
            self.topics.clear()
        for member in list(self.members.values()):
            member.link_changed(up, refusal)

    def on_offers(self, offers: Offers) -> None:
        for member in list(self.members.values()):
            member.offers_changed(offers)

    def on_path(self, path: GoPath) -> None:
        for member in list(self.members.values()):
            member.path_changed(path)

    def on_sample(self, topic: str, sample: str) -> None:
        self.topics.publish(topic, sample)

    def on_ended(self, ended: Ended) -> None:
        """Inform all members; the holder acts on it."""
        for member in list(self.members.values()):
            member.ended_at_bridge(ended)

    def on_refused(self, refused: Refused) -> None:
        """Inform all members; the sender acts on it."""
        for member in list(self.members.values()):
            member.refused_at_bridge(refused)


_hubs: dict[UUID, RobotHub] = {}
# By robot: how long drive messages take, from arrival until they are sent on.
forward_durations: dict[str, Durations] = defaultdict(Durations)


def open_hubs() -> list[RobotHub]:
    """Return the hubs of this process."""
    return list(_hubs.values())


def join(robot_id: UUID, entry: RobotEntry, member: Member) -> RobotHub:
    """Return the robot's hub after adding `member`."""
    hub = _hubs.get(robot_id)
    if hub is None:
        hub = _hubs[robot_id] = RobotHub(robot_id, entry)
    hub.add(member)
    return hub
