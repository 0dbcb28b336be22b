"""Control as one connection has it: the grant at the bridge, renewed for as long as the right to it is confirmed."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress

from robots.link.client import LinkRefused
from robots.wire import Grant, Pause, Refusal, Revoke
from teleop.control.policy import Permit
from teleop.control.rules import LeaseState
from teleop.live.robot_hub import RobotHub

log = logging.getLogger(__name__)

GRANT_S = 3.0  # what the bridge is given at a time
RENEW_S = 1.0
CONFIRMED_S = 2.0  # control that was not confirmed by the database for so long is not renewed


class LeaseRenewer:
    """Made when a connection gets the lease. One of `revoke`, `leave` and `pass_on` ends it.

    `delay_s` tells how long the way to the page and back takes (None: not known yet); the bridge reckons with it.
    """

    def __init__(
        self,
        hub: RobotHub,
        lease: LeaseState,
        *,
        permit: Permit,
        settled: Callable[[], Awaitable[None]],
        refused: Callable[[Refusal], Awaitable[None]],
        delay_s: Callable[[], float | None],
    ) -> None:
        self.lease = lease
        self.fence = lease.fence
        self.permit = permit
        self.is_settled = False  # the bridge has answered, or cannot be asked
        self._room = hub
        self._settled = settled
        self._refused = refused
        self._delay_s = delay_s
        self._again = asyncio.Event()
        # Whoever had this lease before, on another connection: its stick is over, sequence numbers begin anew.
        hub.link.send(Pause(self.fence, "The page was opened anew."))
        self._task = asyncio.create_task(self._keep_granted())

    def renew_soon(self) -> None:
        """Grant again without waiting: the link came up, or the permit changed."""
        self._again.set()

    def revoke(self, reason: str) -> None:
        """Control is over."""
        self._task.cancel()
        self._room.link.send(Revoke(self.fence, reason[:200]))

    def leave(self) -> None:
        """The page is gone, and may come back."""
        self._task.cancel()
        self._room.link.send(Pause(self.fence, "The page is gone."))

    def pass_on(self) -> None:
        """Another connection of the same tab goes on with the same grant."""
        self._task.cancel()

    async def _keep_granted(self) -> None:
        faulty = False  # what lasts is logged once
        while True:
            try:
                if (refusal := await self._why_over()) is not None:
                    await self._refused(refusal)
                    return
                if not self.is_settled:
                    self.is_settled = True
                    await self._settled()
                faulty = False
            except Exception:
                if not faulty:
                    log.exception("control of robot %s was not renewed", self._room.robot_id)
                faulty = True
            self._again.clear()
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._again.wait(), RENEW_S)

    async def _why_over(self) -> Refusal | None:
        """Grant if the right to it is confirmed. Returns why the bridge takes no grant of this control any more."""
        if time.monotonic() - self._room.looked_s < CONFIRMED_S:
            try:
                await self._grant()
            except LinkRefused as error:
                if error.refusal.rule == "lease":
                    return error.refusal
                # The bridge is away or slow. The base stands by then; the page is told by the link.
        return None

    async def _grant(self) -> None:
        await self._room.link.grant(
            Grant(
                fence=self.fence,
                seconds=GRANT_S,
                session=str(self.lease.session),
                holder=self.lease.name,
                holder_id=str(self.lease.user),
                max_share=self.permit.max_share,
                delay_s=self._delay_s(),
            )
        )
