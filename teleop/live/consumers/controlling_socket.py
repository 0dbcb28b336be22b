"""A WebSocket that may get control of its robot, whatever protocol its client speaks: a page, or a program."""

from __future__ import annotations

import logging
import time
from functools import partial
from uuid import UUID

from django.db import DatabaseError

from robots.registry.models import Role
from robots.shared.wire import Ended, Refusal, Refused
from teleop.background.jobs import RequestQueue, run_in_background
from teleop.control.changes import ControlRefused
from teleop.control.lease_checks import Tab, fingerprint
from teleop.control.status import ControlStatus
from teleop.live.consumers.robot_socket import RobotSocket
from teleop.live.control_holder import ControlHolder
from teleop.live.grant_renewal import Delays
from teleop.live.task_sender import TaskSender
from teleop.stop import emergency_stop

log = logging.getLogger(__name__)


class ControllingSocket(RobotSocket):
    """Base of the WebSockets with control, tasks and a stop button. Its client hears what `send_message` sends."""

    def __init__(self) -> None:
        super().__init__()
        self.control: ControlHolder | None = None  # None until `begin_control`

    def prepare(self) -> None:
        """Make what needs the hub, after `join`."""
        self.stop_button = emergency_stop.StopButton(
            self.user, self.through, partial(self.send_refusal, "stop")
        )
        self.requests = RequestQueue()
        self.tasks = TaskSender(self)

    def begin_control(self, token: str) -> ControlHolder:
        """From now on this connection may get control. `token`: of the tab or client, to which a lease belongs."""
        program = self.token.name if self.token else ""
        tab = Tab(token, fingerprint(self.person[1]), self.id, program)
        self.control = ControlHolder(
            self.hub, self.user.id, tab, report=self.send_message, delays=self.delays
        )
        return self.control

    def delays(self) -> Delays:
        """Return how late the client is, for the bridge."""
        return Delays()

    def forwarded(self, was_sent: bool, began_s: float) -> None:
        """Count a drive input that was passed to the link, by the time since it came."""
        if was_sent:
            self.hub.forward_durations.add(time.perf_counter() - began_s)
        else:
            self.refused["link_busy"] += 1  # a newer drive input follows in a moment

    async def end_control(self, control: ControlHolder) -> None:
        """Stop the robot at once: the connection is gone. The lease can be resumed if the client comes back."""
        await control.leave()

    async def on_close(self) -> None:
        """End control, then leave the hub."""
        if not self.joined:
            return
        self.requests.close()
        try:
            if self.control:
                await self.end_control(self.control)
        except (ControlRefused, DatabaseError) as error:
            log.warning("The closing of a connection was not stored; its lease ends by itself: %s", error)
        finally:
            await self.hub.remove(self)

    # --- reports from the hub (robot_hub.Member) --------------------------------------------------------

    @property
    def held_session(self) -> UUID | None:
        """The control session of this connection; None without control."""
        return self.control.session if self.control else None

    @property
    def waits(self) -> bool:
        """Return whether this connection waits in line for control."""
        return self.control is not None and self.control.waits

    @property
    def fence(self) -> int | None:
        return self.control.fence if self.control else None

    @property
    def role_in_control(self) -> Role | None:
        """The role that the person had when they took control; None without control."""
        return self.control.role if self.control else None

    async def follow(self, status: ControlStatus) -> None:
        role_before = self.rights.role
        await super().follow(status)
        if not self.may_see:
            return
        if role_before != self.rights.role:
            await self.role_changed()
        if self.control:
            await self.control.follow(status, self.rights)

    async def role_changed(self) -> None:
        """Inform the client that the person has another role, before control follows it."""

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """Renew control if the link is up again. Inform the client if the bridge is gone."""
        if up and self.control:
            self.control.renew_soon()
        self.report_bridge_gone()

    def ended_at_bridge(self, ended: Ended) -> None:
        """Send the grant again: the bridge ended this control. If the end is final, the bridge refuses the grant."""
        if self.control and ended.fence == self.fence:
            self.control.renew_soon()

    def refused_at_bridge(self, refused: Refused) -> None:
        """Pass on a refusal that concerns this connection's control."""
        if self.fence is not None and refused.fence == self.fence:
            run_in_background(self.send_refusal(refused.of, refused.refusal, refused.seq, refused.fence))

    async def revoke_access(self, refusal: Refusal) -> None:
        """End control and close: this person may not see the robot any more."""
        if self.control:
            self.control.revoke(refusal)
        await super().revoke_access(refusal)
