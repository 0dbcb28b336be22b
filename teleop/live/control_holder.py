"""Control of one robot by one connection: take it, keep it renewed, hand it over, lose it.

Any interface of the console can own a `ControlHolder`. At present, only `RobotConsumer` does.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, TypeVar
from uuid import UUID

from django.utils import timezone
from msgspec import structs

from robots.link.client import LinkRefused
from robots.registry.models import Role
from robots.shared.sentences import say
from robots.shared.wire import Control, Notice, Refusal
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control import services
from teleop.control.changes import ControlRefused, NotStored
from teleop.control.lease_checks import NO_LEASE, Phase, Tab, lapse_reason, phase
from teleop.control.lease_checks import offered as offered_now
from teleop.control.rules import ROLE_LOWERED, Permit
from teleop.control.status import ControlStatus, Rights, SessionEnd, change_key, control_message
from teleop.control.waiting import line
from teleop.live import notices
from teleop.live.grant_renewal import Delays, GrantRenewer
from teleop.live.robot_hub import RobotHub
from teleop.models import EndReason

log = logging.getLogger(__name__)

RELEASED = say("You released control.")
RETRY_S = 1.0  # pause between two attempts to store the end of control

Report = Callable[[Control | Notice], Awaitable[None]]
T = TypeVar("T")


class ControlHolder:
    """One connection that has control of a robot, or may get it.

    The holder follows the lease in the database, as the robot's hub reads it (`follow`). Requests such as
    `take_control` and `hand_over` only change the lease. So control always begins in `follow`. Control also ends in
    `follow`, or earlier by `release`, `revoke`, `leave` or a refusal of the bridge.

    The holder sends nothing to its client. It calls `report` with a `Control` when control has changed, and
    with a `Notice` that contains the reason. `delays` returns how late the client is now.

    Requests raise ControlRefused, LinkRefused or DatabaseError.
    """

    def __init__(
        self,
        hub: RobotHub,
        user_id: UUID,
        tab: Tab,
        *,
        report: Report,
        delays: Callable[[], Delays],
    ) -> None:
        self.tab = tab
        self._hub = hub
        self._user_id = user_id
        self._report = report
        self._delays = delays
        self._renewer: GrantRenewer | None = None
        self._status: ControlStatus | None = None
        self._rights: Rights | None = None
        self._left = False  # a status that arrives after `leave` must not start a renewal
        self._given_up: UUID | None = None  # never renew this session, even if an older status contains it
        self._store_end: Callable[[], None] | None = None  # stores the end of the session that was given up
        self._storing = asyncio.Lock()
        self._reported_key: tuple[object, ...] | None = None
        self._line: set[int] = set()  # ids of the waiters for this control
        self.waits = False  # this connection waits in line
        self._offered = False  # control is offered to this connection
        self._called: int | None = None  # the turn of a lesson for which this person is called
        self._withdrew = False  # this connection left the line, even if an older status still contains it

    @property
    def fence(self) -> int | None:
        """The fence of its control; None without control."""
        return self._renewer.fence if self._renewer else None

    @property
    def session(self) -> UUID | None:
        """Its control session; None without control."""
        return self._renewer.lease.session if self._renewer else None

    @property
    def role(self) -> Role | None:
        """The role that the person had when they took control; None without control."""
        return self._renewer.lease.role if self._renewer else None

    # --- requests -----------------------------------------------------------------------------------

    async def take_control(self) -> UUID:
        """Take control of a robot that no other person controls. Return the session, which `follow` begins."""
        await self._end_lease()  # the database may still contain the session that was given up here
        taken = await self._change(services.lease_take, highest_fence=await self._highest_fence())
        return taken.session

    def undo_take(self, session: UUID, refusal: Refusal | None = None) -> None:
        """End a session that `take_control` took, also if it has not begun here: its caller was refused, or is gone."""
        reason = EndReason.BRIDGE if refusal else EndReason.RELEASED
        words = refusal.sentence if refusal else RELEASED
        if not (session == self.session and self._give_up(reason, words, refusal=refusal)):
            self._end_soon(session, reason, refusal, None)

    async def take_over(self, reason: str) -> None:
        """Take control from another person, as a supervisor or staff."""
        await self._change(services.lease_take_over, reason=reason, highest_fence=await self._highest_fence())

    async def hand_over(self, request_id: int) -> None:
        """Hand control over to a person in line."""
        await self._change(
            services.lease_hand_over, request_id=request_id, highest_fence=await self._highest_fence()
        )

    async def renew(self) -> None:
        """Start a new term."""
        await self._change(services.lease_renew)

    async def resume(self) -> None:
        """Continue with the lease or the place in line of the same tab, after a reload or a network failure."""
        status = self._status
        waiters = status.line if status else []
        waited = any(one.user == self._user_id and one.tab.is_same_tab(self.tab) for one in waiters)
        if waited and await in_database(line.line_resume, **self._me(), now=timezone.now()):
            await self._hub.lease_changed()
        lease = status.lease if status else None
        if lease is None or lease.user != self._user_id or not lease.tab.is_same_tab(self.tab):
            return
        try:
            await in_database(services.lease_resume, **self._me(), now=timezone.now())
            await self._hub.lease_changed()
        except NotStored:
            raise
        except ControlRefused:
            pass  # the lease has just ended, or the right to control has ended

    async def release(self) -> None:
        """Release control. The robot stops first; then the end is stored."""
        if not self._give_up(EndReason.RELEASED, RELEASED, by=self._user_id):
            raise ControlRefused(NO_LEASE)
        # Store the end before the report: a program may read the robot's state as soon as it gets the report.
        try:
            await self._end_lease()
        finally:
            await self._report_control()

    async def ask(self) -> None:
        """Wait in line for control. The holder gets a notice."""
        self._withdrew = False
        await self._change(line.line_join)

    async def withdraw(self) -> None:
        """Leave the line."""
        self._withdrew = True
        await in_database(
            line.line_leave,
            robot_id=self._hub.robot_id,
            user_id=self._user_id,
            connection=self.tab.connection,
            now=timezone.now(),
        )
        await self._changed()

    async def _change(self, step: Callable[..., T], **arguments: Any) -> T:
        """Run one of the lease services, then inform everybody."""
        result = await in_database(step, **self._me(), **arguments, now=timezone.now())
        await self._changed()
        return result

    async def _changed(self) -> None:
        self._reported_key = None  # a request is always answered with `Control`, even if nothing changed
        await self._hub.lease_changed()

    def _me(self) -> dict[str, Any]:
        return {"robot_id": self._hub.robot_id, "user_id": self._user_id, "tab": self.tab}

    async def _highest_fence(self) -> int:
        """Return the highest fence that the bridge has seen. Raises LinkRefused if the robot is out of reach."""
        await self._hub.wait_for_link()
        link = self._hub.link
        if not link.up and link.refusal:
            raise LinkRefused(link.refusal)
        return link.highest_fence

    # --- events -------------------------------------------------------------------------------------

    async def follow(self, status: ControlStatus, rights: Rights) -> None:
        """Follow the lease: start renewing a lease of this connection, stop renewing one that it lost, and report."""
        self._status, self._rights = status, rights
        await self._follow_lease(status, rights)
        await self._end_if_right_ended(rights)
        self._follow_speed_limit(rights)
        await self._report_control()
        await self._report_line(status)

    def renew_soon(self) -> None:
        """Send the grant to the bridge again without delay: the link came up, or the bridge ended this control."""
        if self._renewer:
            self._renewer.renew_soon()

    def revoke(self, refusal: Refusal) -> None:
        """End control without a notice, because the person may not see the robot any more."""
        self._give_up(EndReason.RIGHT, refusal.sentence, refusal=refusal)

    async def leave(self) -> None:
        """Stop the robot at once, but keep the lease for a while: the connection is gone, but the client may return."""
        self._left = True
        renewer, self._renewer = self._renewer, None
        if renewer:
            renewer.leave()
        session = renewer.lease.session if renewer else None
        await in_database(_leave, self._hub.robot_id, self.tab.connection, session)
        await self._hub.lease_changed()

    # --- getting and losing control --------------------------------------------------------------------

    async def _follow_lease(self, status: ControlStatus, rights: Rights) -> None:
        mine = status.lease if self._is_mine(status) else None
        if mine and mine.session == self._given_up:
            mine = None
        if self._renewer and (mine is None or mine.session != self.session):
            await self._lost(self._renewer, status)
        if mine and self._renewer:
            self._renewer.follow(mine)
        if mine and self._renewer is None and not self._left and isinstance(rights.permit, Permit):
            self.waits = self._offered = False  # the person has control, so waits no longer
            log.info(
                "Control of robot %s: fence %d, connection %s",
                self._hub.robot_id,
                mine.fence,
                self.tab.connection,
            )
            self._renewer = GrantRenewer(
                self._hub,
                mine,
                permit=rights.permit,
                answered=self._report_control,
                # The bridge refused: it knows a higher fence, or another session with this fence.
                refused=partial(self._end, EndReason.BRIDGE),
                delays=self._delays,
            )

    def _is_mine(self, status: ControlStatus) -> bool:
        """Return whether this connection has the lease in the database."""
        lease = status.lease
        return (
            lease is not None
            and lease.tab.connection == self.tab.connection
            and phase(lease, status.read_at) is not Phase.LAPSED
        )

    async def _lost(self, renewer: GrantRenewer, status: ControlStatus) -> None:
        """Stop renewing: another connection has the lease now, or the lease has ended."""
        self._renewer = None
        session, lease = renewer.lease.session, status.lease
        if lease and lease.session == session and lease.tab.connection not in ("", self.tab.connection):
            renewer.stop_silently()
            await self._report(notices.GOES_ON_ELSEWHERE)
            return
        # If the end is not stored, the times of the lease give the reason.
        lapsed = lapse_reason(lease or renewer.lease, status.read_at) or "term"
        ending = status.endings.get(session) or SessionEnd(lapsed, "")
        renewer.revoke(ending.note or str(EndReason(ending.reason).label))
        await self._report(notices.control_ended(ending))

    async def _end_if_right_ended(self, rights: Rights) -> None:
        """End control when the right to it ended.

        Control also ends if the person's role is lower now than when they took control: their tasks were
        started with the higher role.
        """
        renewer, permit = self._renewer, rights.permit
        if renewer is None:
            return
        if isinstance(permit, Refusal):
            await self._end(EndReason.RIGHT, permit)
        elif rights.role is not None and rights.role < renewer.lease.role:
            await self._end(EndReason.RIGHT, ROLE_LOWERED)

    def _follow_speed_limit(self, rights: Rights) -> None:
        """Send a changed speed limit at once, with a new grant."""
        renewer, permit = self._renewer, rights.permit
        if renewer and isinstance(permit, Permit) and permit.max_share != renewer.permit.max_share:
            renewer.permit = permit
            renewer.renew_soon()

    async def _end(self, reason: EndReason, refusal: Refusal) -> None:
        if self._give_up(reason, refusal.sentence, refusal=refusal):
            await self._report(notices.control_ended_here(reason, refusal))

    def _give_up(
        self, reason: EndReason, words: str, *, refusal: Refusal | None = None, by: UUID | None = None
    ) -> bool:
        """End control at the bridge now, and store the end in the background. Return False if there was no control."""
        renewer, self._renewer = self._renewer, None
        if renewer is None:
            return False
        renewer.revoke(words)
        self._end_soon(renewer.lease.session, reason, refusal, by)
        return True

    def _end_soon(self, session: UUID, reason: EndReason, refusal: Refusal | None, by: UUID | None) -> None:
        """Never renew this session; store its end in the background."""
        self._given_up = session
        self._reported_key = None  # report again, even if the start of this control was never reported
        self._store_end = partial(_end_lease, self._hub.robot_id, session, reason, refusal, by)
        run_in_background(self._keep_ending())

    async def _end_lease(self) -> None:
        """Store the end of the session that was given up, unless it is stored. Raises ControlRefused if this fails."""
        async with self._storing:
            if (store := self._store_end) is not None:
                await in_database(store)
                self._store_end = None if self._store_end is store else self._store_end

    async def _keep_ending(self) -> None:
        """Try until the end of this session is stored, even if the client is gone. No other session ends."""
        tries = 0
        while self._store_end is not None:
            try:
                await self._end_lease()
            except ControlRefused as error:
                if tries == 0:
                    log.error(
                        "The end of control of robot %s is not stored yet: %s", self._hub.robot_id, error
                    )
                tries += 1
                await asyncio.sleep(RETRY_S)
        await self._hub.lease_changed()

    # --- reports -------------------------------------------------------------------------------------

    async def _report_control(self) -> None:
        status = self._status
        if status is None or self._rights is None:
            return
        if status.lease and status.lease.session == self._given_up:
            status = structs.replace(status, lease=None)
        # Report later: the bridge has not answered the first grant, or the end of control is not stored yet.
        if self._is_mine(status) and not (self._renewer and self._renewer.is_answered):
            return
        control = control_message(status, user=self._user_id, tab=self.tab, rights=self._rights)
        key = change_key(control, status)
        if key != self._reported_key:
            self._reported_key = key
            await self._report(control)

    async def _report_line(self, status: ControlStatus) -> None:
        if self._renewer:
            for one in status.line:
                if one.id not in self._line and one.user != self._user_id:
                    await self._report(notices.request_received(one.name))
        self._line = {one.id for one in status.line}
        mine = next((one for one in status.line if one.tab.connection == self.tab.connection), None)
        if mine is None and self.waits and not self._withdrew:
            await self._report(notices.LEFT_THE_LINE)
        self.waits = mine is not None
        offered = mine is not None and offered_now(status.line, status.read_at) == mine
        if offered and not self._offered:
            await self._report(notices.YOUR_TURN)
        self._offered = offered
        current = status.schedule.current
        turn = current.turn if current is not None else None
        called = turn.id if turn and turn.person == self._user_id and turn.ends_at is None else None
        if called is not None and called != self._called:
            await self._report(notices.CALLED)
        self._called = called


def _leave(robot_id: UUID, connection: str, session: UUID | None) -> None:
    """Store that a connection is gone. Its lease or its place in line may be resumed for a while."""
    now = timezone.now()
    if session is not None:
        services.lease_page_gone(robot_id=robot_id, session=session, connection=connection, now=now)
    line.line_away(robot_id=robot_id, connection=connection)


def _end_lease(
    robot_id: UUID, session: UUID, reason: EndReason, refusal: Refusal | None, by: UUID | None
) -> None:
    services.lease_end(
        robot_id=robot_id, session=session, reason=reason, refusal=refusal, user_id=by, now=timezone.now()
    )
