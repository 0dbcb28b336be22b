"""Emergency stops without an event loop, and all stops on record: afterwards, for a stop waits for nothing."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from uuid import UUID

from django.db import DatabaseError

from fleet import audit
from fleet.accounts.models import User
from fleet.audit import SystemAccount
from fleet.audit.models import Record
from robots.bridge.config import LinkAddress
from robots.link import LinkRefused, stop_once
from robots.models import Robot
from robots.selectors import link_address
from robots.wire import Refusal, Stopped

log = logging.getLogger(__name__)


def press(robot_id: UUID | None, address: LinkAddress, by: str, reason: str = "") -> Stopped | Refusal:
    """Stop one robot, or whichever listens there, over a connection of its own.

    Returns what its bridge said, or why it was not reached.
    """
    try:
        return stop_once(robot_id, address, by, reason)
    except LinkRefused as refused:
        return refused.refusal


def press_all(robots: Sequence[Robot], by: str, reason: str = "") -> list[Stopped | Refusal]:
    """`press` everywhere at once."""
    with ThreadPoolExecutor(max(len(robots), 1)) as threads:
        return list(threads.map(lambda robot: press(robot.id, link_address(robot), by, reason), robots))


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
    """Record that a stop was pressed, so many times; None if that was not possible, which stops nothing.

    `session_id` and `fence` are those of the control session that it interrupts.
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
    except (audit.AuditUnavailable, DatabaseError) as error:
        by = actor.name if isinstance(actor, SystemAccount) else actor.pk
        log.error("a stop of robot %s by %s was sent, but not recorded: %s", robot_id, by, error)
        return None


def record_outcome(record: Record | None, *, actor: User | SystemAccount, result: Stopped | Refusal) -> None:
    """Record what came of a stop or a clear."""
    if record is None:
        return
    outcome = result.code if isinstance(result, Refusal) else result.stop.state
    words = {"words": result.text} if isinstance(result, Refusal) else {}
    try:
        audit.record(record.kind, actor=actor, of=record, outcome=outcome, private=words)
    except (audit.AuditUnavailable, DatabaseError) as error:
        log.error("the outcome %s of record %s was not recorded: %s", outcome, record.pk, error)
