"""The WebSocket of one robot's control page."""

from __future__ import annotations

import logging
import time
from typing import cast

from django.db import DatabaseError

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.wire import (
    Accepted,
    GoPath,
    NotDone,
    Offers,
    Refusal,
    Refused,
    WireError,
    browser_message,
    kind_of,
)
from teleop.background.jobs import run_in_background
from teleop.control.allowed.scopes import needed_scopes, scope_missing
from teleop.control.changes import ControlRefused, NotStored, database_refusal
from teleop.control.lease_checks import check_fence
from teleop.control.status import ControlStatus, RobotEntry
from teleop.live.camera_view_age import CameraViewAge
from teleop.live.consumers.controlling_socket import ControllingSocket
from teleop.live.consumers.message_socket import BUSY, CloseCode
from teleop.live.control_holder import ControlHolder
from teleop.live.grant_renewal import Delays
from teleop.live.recording_sender import RecordingSender
from teleop.live.view_feed import Viewer
from teleop.stop import emergency_stop

log = logging.getLogger(__name__)

# Pages begin a drive message with this text. Any other spelling takes the longer way, by `on_message`.
_DRIVE = '{"t":"drive",'
_HELLO_FIRST = Refusal("hello_first", "The first message is hello.", "wire")


class RobotConsumer(ControllingSocket):
    """One page of one robot: its views, its control, its tasks, its stop button."""

    through = "robot page"

    def __init__(self) -> None:
        super().__init__()
        self.viewer: Viewer | None = None
        self.camera_view = CameraViewAge()

    # --- opening and closing -----------------------------------------------------------------------

    async def on_open(self) -> None:
        """Join the robot's hub, if this person may see the robot."""
        if await self.join() is not None:
            self.prepare()
            self.recordings = RecordingSender(self)

    async def on_close(self) -> None:
        """Stop the robot at once. The lease can be resumed if the page comes back."""
        if self.viewer:
            self.viewer.leave()
        await super().on_close()

    # --- messages from the page --------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        """Act on one message. Drive input takes the shortest way; a stop waits for nothing."""
        message = browser_message(raw)
        if isinstance(message, wire.Stop):  # counts for the flood limit, but is never refused
            self.stop_button.press(self.hub.link, flood=not self.spend())
        elif not await self.within_budget(kind_of(message)):
            return
        elif not self.opens(*(needed := needed_scopes(message))):
            await self.send_refusal(kind_of(message), scope_missing(needed), getattr(message, "seq", None))
        elif isinstance(message, wire.Drive):
            await self._drive(message, raw)
        elif isinstance(message, wire.CameraView):
            if self.camera_view.observe(message.age_ms) and self.control:
                self.control.renew_soon()
        elif isinstance(message, wire.ShowJoints):
            self.draws_joints = message.wanted
            self.hub.viewers_changed()
        elif isinstance(message, wire.TaskRequest):
            await self.tasks.start(message)
        elif isinstance(message, wire.RecordingRequest):
            await self.recordings.start(message)
        elif isinstance(message, wire.Ack):
            if self.viewer:
                await self.viewer.acknowledge()
        elif isinstance(message, wire.Ping):
            await self.send_message(wire.Pong(message.sent_ms))
        elif isinstance(message, wire.Refresh):
            await self._refresh_offers(message)
        elif not self.requests.add(lambda: self._do(message)):
            await self.send_refusal(kind_of(message), BUSY)

    def on_message_at_once(self, raw: str) -> bool:
        """Forward the holder's drive input to a bridge on this computer."""
        link, began_s = self.hub.link, time.perf_counter()
        if self.fence is None or not raw.startswith(_DRIVE) or not link.has_lane:
            return False
        try:
            drive = browser_message(raw)
        except WireError:
            return False
        may = isinstance(drive, wire.Drive) and drive.fence == self.fence and self.opens(Scope.DRIVE)
        if not may or not self.spend():
            return False
        self.forwarded(link.forward_by_lane(raw), began_s)
        return True

    async def _drive(self, drive: wire.Drive, raw: str) -> None:
        if drive.fence == self.fence:
            began_s = time.perf_counter()
            self.forwarded(await self.hub.link.forward(raw), began_s)
            return
        refusal = check_fence(drive.fence, self.fence)
        if refusal is not None:
            await self.send_refusal("drive", refusal, drive.seq, drive.fence)

    async def _refresh_offers(self, refresh: wire.Refresh) -> None:
        refusal = self.hub.refresh_offers(self)
        kind = kind_of(refresh)
        await self.answer(Refused(kind, refusal, refresh.seq) if refusal else Accepted(kind, refresh.seq))

    async def _do(self, message: wire.BrowserMessage) -> None:
        """Carry out a request that needs the database."""
        try:
            if isinstance(message, wire.Hello):
                await self._hello(message)
            elif self.control is None:
                raise ControlRefused(_HELLO_FIRST)
            else:
                await self._change(message, self.control)
        except NotStored as refused:
            await self._not_now(message, refused.refusal)
        except NotDone as refused:
            await self.send_refusal(kind_of(message), refused.refusal)
        except DatabaseError as error:
            log.error("%s on %s: %s", kind_of(message), self.scope["path"], error)
            await self._not_now(message, database_refusal(error))

    async def _not_now(self, message: wire.BrowserMessage, refusal: Refusal) -> None:
        await self.send_refusal(kind_of(message), refusal)
        if isinstance(message, wire.Hello):
            # A page sends hello once per connection. After the close it reconnects, and sends hello again.
            await self.close(CloseCode.TRY_AGAIN, refusal.text)

    async def _hello(self, hello: wire.Hello) -> None:
        if self.control is not None:
            raise ControlRefused(Refusal("hello_twice", "This page has already sent hello.", "wire"))
        control = self.begin_control(hello.tab)
        await self._welcome()
        await self.hub.read_status_for(self)
        await control.resume()
        self.viewer = Viewer(self.hub.views, self.asgi_send)
        self.viewer.is_driver = self.fence is not None
        self.wants_views = True
        self.hub.viewers_changed()
        if self.hub.link.offers:
            await self.send_message(self.hub.link.offers)
        if self.hub.link.path.path_cm:
            await self.send_message(self.hub.link.path)
        await self.hub.wait_for_link()
        self.report_bridge_gone()

    def delays(self) -> Delays:
        trip_s = self.viewer.delay_s if self.viewer else None
        return Delays(trip_s, self.camera_view.age_s(), time.monotonic() - self.heard_s)

    async def _change(self, message: wire.BrowserMessage, control: ControlHolder) -> None:
        """Change who has control, or clear the stop."""
        match message:
            case wire.Take():
                await control.take_control()
            case wire.TakeOver(reason=reason):
                await control.take_over(reason)
            case wire.HandOver(number=number):
                await control.hand_over(number)
            case wire.Renew():
                await control.renew()
            case wire.Release():
                await control.release()
            case wire.Ask():
                await control.ask()
            case wire.AskCancel():
                await control.withdraw()
            case wire.Clear(number=number):
                await emergency_stop.clear(self.hub.link, number, user=self.user, tab=control.tab)

    # --- reports from the hub (robot_hub.Member) --------------------------------------------------------

    async def follow(self, status: ControlStatus) -> None:
        await super().follow(status)
        if self.viewer:
            self.viewer.is_driver = self.fence is not None

    async def role_changed(self) -> None:
        await self._welcome()

    async def robot_edited(self, entry: RobotEntry) -> None:
        """Send the page the changed entry of the robot."""
        await self._welcome()
        self.report_bridge_gone()

    def offers_changed(self, offers: Offers) -> None:
        """Send the page the robot's capabilities. A page that has not sent hello yet gets them after its hello."""
        if self.wants_views:
            run_in_background(self.send_message(offers))

    def path_changed(self, path: GoPath) -> None:
        """Send the page the path of the robot's navigation."""
        if self.wants_views:
            run_in_background(self.send_message(path))

    async def revoke_access(self, refusal: Refusal) -> None:
        """End control and close: this person may not see the robot any more."""
        if self.viewer:
            self.viewer.leave()
        await super().revoke_access(refusal)

    # --- messages to the page ------------------------------------------------------------------------

    async def answer(self, answer: Accepted | Refused) -> None:
        if not (isinstance(answer, Refused) and answer.refusal.code == "bridge_silent"):
            await super().answer(answer)  # else the page shows that already

    async def _welcome(self) -> None:
        if self.control is not None and self.rights.role:
            role = cast(wire.Role, self.rights.role.value)
            await self.send_message(wire.Welcome(wire.PROTOCOL, self.name, role, self.hub.entry.facts))

    def report_bridge_gone(self) -> None:
        """Inform the page that the bridge is gone. A page that has not sent hello yet is informed after its hello."""
        if self.control is not None:
            super().report_bridge_gone()
