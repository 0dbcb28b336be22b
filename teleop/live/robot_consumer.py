"""The live page of one robot."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import Any, cast
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone
from msgspec import structs

from robots import wire
from robots.link.client import LinkRefused
from robots.registry.models import Role
from robots.wire import (
    Accepted,
    Ended,
    NotDone,
    Offers,
    Refusal,
    Refused,
    WireError,
    browser_message,
    kind_of,
)
from teleop.background.database import in_database
from teleop.background.tasks import RequestQueue, run_beside
from teleop.control import services
from teleop.control.policy import ROLE_LOWERED, Permit
from teleop.control.rules import NO_LEASE, Phase, Tab, fingerprint, lapse, open_asks, phase
from teleop.control.services import ControlRefused
from teleop.control.status import Ending, Registered, Standing, control_for, gist
from teleop.live import notices, robot_hub
from teleop.live.lease_renewal import Grip
from teleop.live.picture_feed import Viewer
from teleop.live.robot_socket import RobotSocket
from teleop.live.socket import CloseCode
from teleop.live.tasks import BUSY, Orders, not_held
from teleop.models import EndReason
from teleop.stop import emergency_stop

log = logging.getLogger(__name__)

_DRIVE = '{"t":"drive",'  # as pages begin it; one that is written otherwise takes the longer way
AGAIN_S = 1.0  # until what could not be stored is tried again


class RobotConsumer(RobotSocket):
    """One page of one robot: its pictures, its control, its stop.

    What the connection holds follows the lease in the database, as its room reads it (`stands`); requests only
    change the lease. So taking, being handed control and losing it by whatever door are one path.
    """

    through = "robot page"

    def __init__(self) -> None:
        super().__init__()
        self.tab: Tab | None = None
        self.viewer: Viewer | None = None
        self.grip: Grip | None = None
        self._gone = False  # a look that is under way gives nothing to a page that is closed
        self._gave_up: UUID | None = None  # never gripped again, whatever an older look says
        self._to_end: Callable[[], None] | None = None  # ends in the database what was given up here
        self._one_end = asyncio.Lock()
        self._standing: Standing | None = None
        self._told: tuple[object, ...] | None = None
        self._withdrew = False  # its question itself, whatever a look before that still says of it
        self._asks: set[int] = set()
        self._asking = False

    # --- opening and closing -----------------------------------------------------------------------

    async def opened(self) -> None:
        """Let this person in, if they may look at the robot."""
        entry = await self.find_robot()
        if entry is not None:
            self.stop_button = emergency_stop.StopButton(
                self.user, self.through, partial(self.refuse, "stop")
            )
            self.requests = RequestQueue()
            self.orders = Orders(self)
            self.room = robot_hub.enter(self.robot_id, entry, self)

    async def closed(self) -> None:
        """Zero at once; the lease waits for the page to come back."""
        self._gone = True
        if not self.entered:
            return
        held, self.grip = self.grip, None
        if held:
            held.leave()
        self.requests.close()
        if self.viewer:
            self.viewer.leave()
        try:
            await in_database(_left, self.robot_id, self.id, held.holding.session if held else None)
            await self.room.changed()
        except (ControlRefused, DatabaseError) as error:
            log.warning("that a page is gone was not noted; its lease lapses by itself: %s", error)
        finally:
            await self.room.remove(self)

    # --- what the page says ------------------------------------------------------------------------

    async def heard(self, raw: str) -> None:
        """One message. A drive message takes no detour, a stop waits for nothing."""
        message = browser_message(raw)
        if isinstance(message, wire.Stop):  # paid for, and never refused
            self.stop_button.press(self.room.link, flood=not self.spend())
        elif not await self.within_budget(kind_of(message)):
            return
        elif isinstance(message, wire.Drive):
            await self._drive(message, raw)
        elif isinstance(message, wire.Order):
            await self.orders.take(message)
        elif isinstance(message, wire.Ack):
            if self.viewer:
                await self.viewer.drawn()
        elif isinstance(message, wire.Ping):
            await self.tell(wire.Pong(message.sent_ms))
        elif isinstance(message, wire.Refresh):
            await self._refresh(message)
        elif not self.requests.add(lambda: self._do(message)):
            await self.refuse(kind_of(message), BUSY)

    def heard_now(self, raw: str) -> bool:
        """The stick of who has control goes on to a bridge on this computer before anything else is done."""
        grip = self.grip
        if grip is None or not raw.startswith(_DRIVE) or not self.room.link.has_lane:
            return False
        try:
            drive = browser_message(raw)
        except WireError:
            return False
        if not isinstance(drive, wire.Drive) or drive.fence != grip.fence or not self.spend():
            return False
        if not self.room.link.forward_now(raw):
            self.refused["link_busy"] += 1  # a newer one follows in a moment
        return True

    async def _drive(self, drive: wire.Drive, raw: str) -> None:
        grip = self.grip
        if grip is not None and grip.fence == drive.fence:
            if not await self.room.link.forward(raw):
                self.refused["link_busy"] += 1  # a newer one follows in a moment
            return
        refusal = not_held(drive.fence, self.fence)
        if refusal is not None:
            await self.refuse("drive", refusal, drive.seq, drive.fence)

    async def _refresh(self, refresh: wire.Refresh) -> None:
        refusal = self.room.refresh(self)
        kind = kind_of(refresh)
        await self.answer(Refused(kind, refusal, refresh.seq) if refusal else Accepted(kind, refresh.seq))

    async def _do(self, message: wire.BrowserMessage) -> None:
        """One errand: a request that needs the database."""
        try:
            if isinstance(message, wire.Hello):
                await self._hello(message)
            elif self.tab is None:
                raise ControlRefused(Refusal("hello_first", "The first message is hello.", "wire"))
            else:
                await self._change(message, self.tab)
        except services.NotStored as refused:
            await self._not_now(message, refused.refusal)
        except NotDone as refused:
            await self.refuse(kind_of(message), refused.refusal)
        except DatabaseError as error:
            log.error("%s on %s: %s", kind_of(message), self.scope["path"], error)
            await self._not_now(message, services.let_down(error))

    async def _not_now(self, message: wire.BrowserMessage, refusal: Refusal) -> None:
        await self.refuse(kind_of(message), refusal)
        if isinstance(message, wire.Hello):  # said once; the page comes back by itself, and says it then
            await self.close(CloseCode.TRY_AGAIN, refusal.text)

    async def _hello(self, hello: wire.Hello) -> None:
        if self.tab is not None:
            raise ControlRefused(Refusal("hello_twice", "This page has said hello already.", "wire"))
        self.tab = Tab(hello.tab, fingerprint(self.person[1]), self.id)
        await self._welcome()
        await self.room.look_for(self)
        holding = self._standing.holding if self._standing else None
        if holding and holding.user == self.user.id and holding.tab.is_same_tab(self.tab):
            try:
                await in_database(services.lease_resume, **self._me(), now=timezone.now())
                await self.room.changed()
            except services.NotStored:
                raise
            except ControlRefused:
                pass  # It lapsed just now, or the right to it ended.
        self.viewer = Viewer(self.room.views, self.asgi_send)
        self.viewer.drives = self.grip is not None
        self.looks = True
        self.room.watchers_changed()
        if self.room.link.offers:
            await self.tell(self.room.link.offers)
        await self.room.link_settles()
        self.tell_if_gone()

    async def _change(self, message: wire.BrowserMessage, tab: Tab) -> None:
        """Change who has control, or the stop latch; then everybody is told."""
        me, now = self._me(), timezone.now()
        match message:
            case wire.Take():
                await self._end_lease()  # what was given up here would be this page's own yet
                await in_database(
                    services.lease_take, **me, highest_fence=await self._bridge_fence(), now=now
                )
            case wire.TakeOver(reason=reason):
                await in_database(
                    services.lease_take_over,
                    **me,
                    reason=reason,
                    highest_fence=await self._bridge_fence(),
                    now=now,
                )
            case wire.HandOver(request=request):
                await in_database(
                    services.lease_hand_over,
                    **me,
                    request_id=request,
                    highest_fence=await self._bridge_fence(),
                    now=now,
                )
            case wire.Renew():
                await in_database(services.lease_renew, **me, now=now)
            case wire.Release():
                if not self._give_up(EndReason.RELEASED, "Control was given back.", by=self.user.id):
                    raise ControlRefused(NO_LEASE)
                await self._tell_control()
                await self._end_lease()
                return
            case wire.Ask():
                self._withdrew = False
                await in_database(services.control_ask, **me, now=now)
            case wire.AskCancel():
                self._withdrew = True
                await in_database(
                    services.control_ask_cancel,
                    robot_id=self.robot_id,
                    connection=self.id,
                    gone=False,
                    now=now,
                )
            case wire.Clear(number=number):
                await emergency_stop.clear(self.room.link, number, user=self.user, tab=tab)
                return
        self._told = None  # this is its answer, also if nothing is other than before
        await self.room.changed()

    def _me(self) -> dict[str, Any]:
        return {"robot_id": self.robot_id, "user_id": self.user.id, "tab": self.tab}

    async def _bridge_fence(self) -> int:
        """The highest fencing number that the bridge knows; nobody gets control of a robot out of reach."""
        await self.room.link_settles()
        link = self.room.link
        if not link.up and link.refusal:
            raise LinkRefused(link.refusal)
        return link.highest_fence

    # --- what the room says (rooms.Member) -----------------------------------------------------------

    @property
    def held_session(self) -> UUID | None:
        """The control session that this page has."""
        return self.grip.holding.session if self.grip else None

    @property
    def fence(self) -> int | None:
        """The fencing number of that."""
        return self.grip.fence if self.grip else None

    @property
    def role_in_control(self) -> Role | None:
        """The role in which that was got."""
        return self.grip.holding.role if self.grip else None

    async def stands(self, standing: Standing) -> None:
        """Follow the lease: grip what is ours, let go what is not, say what is new."""
        self._standing = standing
        role_before = self.rights.role
        await super().stands(standing)
        if not self.may_look:
            return
        if role_before != self.rights.role:
            await self._welcome()
        await self._follow_lease(standing)
        await self._follow_permit()
        if self.viewer:
            self.viewer.drives = self.grip is not None
        await self._tell_control()
        await self._tell_of_asks(standing)

    async def edited(self, entry: Registered) -> None:
        """The robot was edited."""
        await self._welcome()
        self.tell_if_gone()

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """Say that the bridge is away, or grip again when it is back."""
        if up and self.grip:
            self.grip.renew_soon()
        self.tell_if_gone()

    def offered(self, offers: Offers) -> None:
        """Say what the robot offers now; a page that has not said hello is told then."""
        if self.looks:
            run_beside(self.tell(offers))

    def ended_at_bridge(self, ended: Ended) -> None:
        """Look what came in between, and grip again if nothing did."""
        if self.grip and ended.fence == self.grip.fence:
            self.grip.renew_soon()

    def refused_at_bridge(self, refused: Refused) -> None:
        """Pass on what was refused of ours."""
        if self.grip and refused.fence == self.fence:
            run_beside(self.refuse(refused.of, refused.refusal, refused.seq, refused.fence))

    # --- control on this connection ------------------------------------------------------------------

    async def _follow_lease(self, standing: Standing) -> None:
        ours = standing.holding if self._is_ours(standing) else None
        if ours and ours.session == self._gave_up:
            ours = None
        if self.grip and (ours is None or ours.session != self.held_session):
            await self._lost(standing)
        if ours and self.grip is None and not self._gone and isinstance(self.rights.permit, Permit):
            self._asking = False  # if it asked, it has its answer
            self.grip = Grip(
                self.room,
                ours,
                permit=self.rights.permit,
                settled=self._tell_control,
                # The bridge knows better: a higher fencing number, another session under this one.
                refused=partial(self._control_ended, EndReason.BRIDGE),
                delay_s=lambda: self.viewer.delay_s if self.viewer else None,
            )

    def _is_ours(self, standing: Standing) -> bool:
        """Whether this connection has the lease, by the table."""
        holding = standing.holding
        return (
            holding is not None
            and holding.tab.connection == self.id
            and phase(holding, standing.read_at) is not Phase.LAPSED
        )

    async def _lost(self, standing: Standing) -> None:
        """Control went elsewhere, or ended, by another door than this connection."""
        if self.grip is None:
            return
        session, now_held = self.grip.holding.session, standing.holding
        if now_held and now_held.session == session and now_held.tab.connection not in ("", self.id):
            self.grip.pass_on()
            self.grip = None
            await self.tell(notices.GOES_ON_ELSEWHERE)
            return
        # Over by the clock counts, even while that cannot be recorded.
        lapsed = lapse(now_held or self.grip.holding, standing.read_at) or "term"
        ending = standing.endings.get(session) or Ending(lapsed, "")
        self.grip.revoke(ending.note or str(EndReason(ending.reason).label))
        self.grip = None
        await self.tell(notices.control_ended(ending))

    async def _follow_permit(self) -> None:
        """End control when the right to it ended; follow a changed limit.

        Also when the role is a lower one than that in which control was got: what was begun in that ends with control.
        """
        permit, role = self.rights.permit, self.rights.role
        if self.grip is None:
            return
        if isinstance(permit, Refusal):
            await self._control_ended(EndReason.RIGHT, permit)
        elif role is not None and role < self.grip.holding.role:
            await self._control_ended(EndReason.RIGHT, ROLE_LOWERED)
        elif permit.max_share != self.grip.permit.max_share:
            self.grip.permit = permit
            self.grip.renew_soon()

    async def _control_ended(self, reason: EndReason, refusal: Refusal) -> None:
        if self._give_up(reason, refusal.text, refusal=refusal):
            await self.tell(notices.control_ended_here(reason, refusal))

    def _give_up(
        self, reason: EndReason, words: str, *, refusal: Refusal | None = None, by: UUID | None = None
    ) -> bool:
        """End control here and, beside, the lease. False if there was none."""
        session = self._let_go(words)
        if session is None:
            return False
        self._to_end = partial(_end_lease, self.robot_id, session, reason, refusal, by)
        run_beside(self._keep_ending())
        return True

    async def _end_lease(self) -> None:
        """End the lease of what was given up here, unless that is done. ControlRefused: it cannot be stored."""
        async with self._one_end:
            if (end := self._to_end) is not None:
                await in_database(end)
                self._to_end = None if self._to_end is end else self._to_end

    async def _keep_ending(self) -> None:
        """What cannot be stored is tried again, also without the page: it refers to its session, whoever has it."""
        tries = 0
        while self._to_end is not None:
            try:
                await self._end_lease()
            except ControlRefused as error:
                if tries == 0:
                    log.error("the end of control of robot %s is not stored yet: %s", self.robot_id, error)
                tries += 1
                await asyncio.sleep(AGAIN_S)
        await self.room.changed()

    async def cut_off(self, refusal: Refusal) -> None:
        """This person may not even look any more."""
        self._give_up(EndReason.RIGHT, refusal.text, refusal=refusal)
        if self.viewer:
            self.viewer.leave()
        await super().cut_off(refusal)

    def _let_go(self, reason: str) -> UUID | None:
        """End control on this connection, whatever the database says yet. Returns the session, if there was one."""
        grip, self.grip = self.grip, None
        if grip is None:
            return None
        self._gave_up = grip.holding.session
        self._told = None  # say how control stands, even if the page was never told that it had it
        grip.revoke(reason)
        return grip.holding.session

    # --- what the page is told -----------------------------------------------------------------------

    async def _welcome(self) -> None:
        if self.tab is not None and self.rights.role:
            role = cast(wire.Role, self.rights.role.value)
            await self.tell(wire.Welcome(wire.PROTOCOL, self.name, role, self.room.entry.facts))

    def tell_if_gone(self) -> None:
        """Say that the bridge is away; a page that has not said hello is told then."""
        if self.tab is not None:
            super().tell_if_gone()

    async def _tell_control(self) -> None:
        standing = self._standing
        if standing is None or self.tab is None:
            return
        if standing.holding and standing.holding.session == self._gave_up:
            standing = structs.replace(standing, holding=None)
        # Just got, and the bridge has not answered; or just lost, and the lease not ended yet: said in a moment.
        if self._is_ours(standing) and not (self.grip and self.grip.is_settled):
            return
        control = control_for(standing, user=self.user.id, tab=self.tab, rights=self.rights)
        now = gist(control, standing)
        if now != self._told:
            self._told = now
            await self.tell(control)

    async def _tell_of_asks(self, standing: Standing) -> None:
        asks = open_asks(standing.asks, standing.read_at)
        if self.grip:
            for ask in asks:
                if ask.id not in self._asks:
                    await self.tell(notices.somebody_asks(ask.name))
        self._asks = {ask.id for ask in asks}
        asking = any(ask.tab.connection == self.id for ask in asks)
        if self._asking and not asking and not self._withdrew:
            await self.tell(notices.answered(free=standing.holding is None))
        self._asking = asking


def _left(robot_id: UUID, connection: str, session: UUID | None) -> None:
    """A page is gone: its lease may be resumed for a while, its question is withdrawn."""
    now = timezone.now()
    if session is not None:
        services.lease_lost(robot_id=robot_id, session=session, connection=connection, now=now)
    services.control_ask_cancel(robot_id=robot_id, connection=connection, gone=True, now=now)


def _end_lease(
    robot_id: UUID, session: UUID, reason: EndReason, refusal: Refusal | None, by: UUID | None
) -> None:
    now = timezone.now()
    services.lease_end(
        robot_id=robot_id, session=session, reason=reason, refusal=refusal, user_id=by, now=now
    )
