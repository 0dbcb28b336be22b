"""Emergency stops for code without an event loop, and the records of all stops.

A record is written after the stop, so that it does not delay the stop.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence
from concurrent.futures import Future
from typing import NamedTuple
from uuid import UUID, uuid4

from django.db import DatabaseError

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.command_line import SystemAccount
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from robots.link import stop_courier as courier
from robots.link.connections import LinkRefused
from robots.link.stop_delivery import reach, stop_message, wait_for
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.pending_stops import WaitingStop
from robots.shared.sentences import say
from robots.shared.wire import LinkStop, Refusal, Stopped

log = logging.getLogger(__name__)


class Pending(NamedTuple):
    """A stop that is not confirmed yet; it is delivered as soon as bridge or watchdog can be reached."""

    refusal: Refusal  # code "pending", and why the stop is not confirmed
    outcome: Future[Stopped | Refusal]  # the answer, if this process receives it
    waiting: WaitingStop

    def withdraw(self) -> None:
        """Drop the pending stop: this robot was not meant."""
        courier.pending_stops().settle(self.waiting, self.refusal)


Result = Stopped | Refusal | Pending


def press_all(robots: Sequence[Robot], by: str, reason: str = "") -> list[Result]:
    """Stop these robots at the same time. Returns for each the answer or a pending stop."""
    return press_at([(robot.id, link_address(robot)) for robot in robots], by, reason)


def press_at(places: Sequence[tuple[UUID | None, LinkAddress]], by: str, reason: str = "") -> list[Result]:
    """Stop the robots at these addresses (None: any robot there), as `press_all`."""
    stops = [stop_message(robot_id, by, reason, uuid4()) for robot_id, _ in places]
    answers = wait_for(_reach_all([address for _, address in places], stops))
    return [
        keep_pending(robot_id, address, stop, answer) if isinstance(answer, LinkRefused) else answer
        for (robot_id, address), stop, answer in zip(places, stops, answers, strict=True)
    ]


async def _reach_all(
    addresses: Sequence[LinkAddress], stops: Sequence[LinkStop]
) -> list[Stopped | Refusal | LinkRefused]:
    async def reached(address: LinkAddress, stop: LinkStop) -> Stopped | Refusal | LinkRefused:
        try:
            return await reach(address, stop)
        except LinkRefused as refused:
            return refused

    return await asyncio.gather(*map(reached, addresses, stops))


def keep_pending(robot_id: UUID | None, address: LinkAddress, stop: LinkStop, why: LinkRefused) -> Pending:
    """Keep an unanswered stop until it is answered."""
    outcome: Future[Stopped | Refusal] = Future()

    def settled(answer: Stopped | Refusal) -> None:
        if not outcome.done():
            outcome.set_result(answer)

    waiting, written = courier.keep_pending(robot_id, address, stop, settled)
    then = say("It will be delivered as soon as possible.")
    if not written:
        then = say(
            "It will be delivered as soon as possible, but only while this program runs: it could not be written to "
            "the disk."
        )
    key = "The stop is pending, not confirmed yet. {why} {then} Use the red button on the robot."
    text = say(key, why=why.refusal.sentence, then=then)
    return Pending(Refusal("pending", text, "robot", {"because": why.refusal.code}), outcome, waiting)


def record_press(
    robot_id: UUID,
    *,
    actor: User | SystemAccount,
    through: str,
    reason: str = "",
    session_id: UUID | None = None,
    fence: int | None = None,
    times: int = 1,
) -> Record | None:
    """Record that a stop was pressed `times` times. Returns None if that is impossible; the stop counts anyway.

    `session_id` and `fence` belong to the control session that the stop interrupts.
    """
    try:
        name = Robot.objects.filter(pk=robot_id).values_list("name", flat=True).first()
        return audit.record(
            "stop.press",
            actor=actor,
            robot_id=robot_id,
            robot_name=name or "",
            session_id=session_id,
            fence=fence,
            parameters={"through": through, "times": times} if times > 1 else {"through": through},
            text=reason,
        )
    except (AuditUnavailable, DatabaseError) as error:
        by = actor.name if isinstance(actor, SystemAccount) else actor.pk
        log.error("a stop of robot %s by %s was sent, but not recorded: %s", robot_id, by, error)
        return None


def record_outcome(record: Record | None, *, actor: User | SystemAccount, result: Result) -> None:
    """Record the outcome of a stop or a clear."""
    if record is None:
        return
    if isinstance(result, Pending):
        result = result.refusal
    outcome = result.code if isinstance(result, Refusal) else result.stop.state
    words = {"words": result.sentence} if isinstance(result, Refusal) else {}
    try:
        audit.record(record.kind, actor=actor, of=record, outcome=outcome, private=words)
    except (AuditUnavailable, DatabaseError) as error:
        log.error("the outcome %s of record %s was not recorded: %s", outcome, record.pk, error)
