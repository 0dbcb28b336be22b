"""Keeps the grant at the bridge renewed while the database confirms the holder's right to control."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress

from django.utils import timezone
from msgspec import Struct, structs

from robots.link.client import LinkRefused
from robots.shared.sentences import say
from robots.shared.wire import Grant, Pause, Refusal, Revoke
from teleop.control.lease_checks import LeaseState
from teleop.control.rules import Permit
from teleop.live.robot_hub import RobotHub

log = logging.getLogger(__name__)

LONGEST_REASON = 200  # characters; a longer one is cut, and stays English
GRANT_S = 3.0  # how long one grant lasts at the bridge
RENEW_S = 1.0
CONFIRMED_S = 2.0  # without confirmation by the database for this time, control is not renewed


class Delays(Struct, frozen=True):
    """How late the holder's client is, in seconds: for the bridge, which does not drive for an absent holder."""

    delay_s: float | None = None  # round trip, which the bridge adds to its latency; None: not known yet
    camera_s: float | None = None  # age of the picture by which the holder drives; None: not by a camera
    silent_s: float | None = None  # since the client's last message; None: it sends no stream of messages


class GrantRenewer:
    """Renews the grant of one connection's lease from its start until `revoke`, `leave` or `stop_silently`.

    `answered` is called after the first grant, `refused` if the bridge's refusal of this control is final.
    """

    def __init__(
        self,
        hub: RobotHub,
        lease: LeaseState,
        *,
        permit: Permit,
        answered: Callable[[], Awaitable[None]],
        refused: Callable[[Refusal], Awaitable[None]],
        delays: Callable[[], Delays],
    ) -> None:
        self.lease = lease
        self.fence = lease.fence
        self.permit = permit
        self.is_answered = False  # the bridge has answered the first grant, or cannot be reached
        self._hub = hub
        self._answered = answered
        self._refused = refused
        self._delays = delays
        self._soon = asyncio.Event()
        self._ended = False
        # Another connection may have had this lease: its drive input ends now, sequence numbers start again.
        hub.link.send(Pause(self.fence, say("The page was opened again.")))
        self._task = asyncio.create_task(self._keep_renewing())

    def follow(self, lease: LeaseState) -> None:
        """Follow a change of the same lease; its term may end earlier or later now."""
        changed = lease.term_ends_at != self.lease.term_ends_at
        self.lease = lease
        if changed:
            self.renew_soon()

    def renew_soon(self) -> None:
        """Send the grant again without waiting: the link came up, or the permit changed."""
        self._soon.set()

    def revoke(self, reason: str) -> None:
        """End control: stop renewing, and inform the bridge."""
        self._end()
        words = reason if len(reason) <= LONGEST_REASON else reason[:LONGEST_REASON]
        self._hub.link.send(Revoke(self.fence, words))

    def leave(self) -> None:
        """Pause control: the page is gone and may come back."""
        self._end()
        self._hub.link.send(Pause(self.fence, say("The page is gone.")))

    def stop_silently(self) -> None:
        """Stop renewing, but send the bridge nothing: another connection of the same tab continues with this grant."""
        self._end()

    def _end(self) -> None:
        self._ended = True
        self._task.cancel()

    async def _keep_renewing(self) -> None:
        faulty = False  # a lasting fault is logged once
        while not self._ended:  # before Python 3.12, `wait_for` may lose a cancellation
            self._soon.clear()  # before the attempt: a change during the attempt is sent right after it
            try:
                if (refusal := await self._try_grant()) is not None:
                    await self._refused(refusal)
                    return
                if not self.is_answered:
                    self.is_answered = True
                    await self._answered()
                faulty = False
            except Exception:
                if not faulty:
                    log.exception("Control of robot %s was not renewed.", self._hub.robot_id)
                faulty = True
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._soon.wait(), RENEW_S)

    async def _try_grant(self) -> Refusal | None:
        """Send the grant if the right to control is confirmed. Returns the bridge's refusal if it is final."""
        if time.monotonic() - self._hub.confirmed_s < CONFIRMED_S:
            try:
                await self._grant()
            except LinkRefused as error:
                if error.refusal.rule == "lease":
                    return error.refusal
                # The bridge is down or slow: without a grant its robot stops, and the link informs the page.
        return None

    async def _grant(self) -> None:
        """Send a grant that ends with the term at the latest, so that the bridge ends control by its own clock."""
        left_s = (self.lease.term_ends_at - timezone.now()).total_seconds()
        if left_s <= 0.0:
            return
        await self._hub.link.grant(
            Grant(
                fence=self.fence,
                seconds=min(GRANT_S, left_s),
                session=str(self.lease.session),
                holder=self.lease.name,
                holder_id=str(self.lease.user),
                max_share=self.permit.max_share,
                **structs.asdict(self._delays()),
            )
        )
