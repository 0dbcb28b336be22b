"""Emergency stop: sent first, recorded after. It is never refused, and waits for no database."""

from __future__ import annotations

import asyncio
import logging
from uuid import UUID

from django.utils import timezone

from fleet import audit
from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.bridge.config import LinkAddress
from robots.link import BridgeLink, LinkRefused, stop_once
from robots.wire import LinkClear, LinkStop, Refusal, Stopped
from teleop.database import in_database
from teleop.rules import Tab
from teleop.services import clear_begin

log = logging.getLogger(__name__)


async def press(link: BridgeLink, *, user: User, through: str) -> Stopped | Refusal:
    """Stop the robot behind `link`; returns the latch, or why the bridge did not confirm it."""
    answer = asyncio.ensure_future(link.stop(LinkStop(by=user.display_name)))
    await asyncio.sleep(0)  # now it is on its way
    pressed = await in_database(record_press, link.robot_id, user, through)
    try:
        result: Stopped | Refusal = await answer
    except LinkRefused as refused:
        result = refused.refusal
    await in_database(record_outcome, pressed, user, result)
    return result


async def clear(link: BridgeLink, *, user: User, tab: Tab | None) -> None:
    """Release the latch, if this person may and it can be recorded. Raises ControlRefused or LinkRefused."""
    cleared = await in_database(
        clear_begin, robot_id=link.robot_id, user_id=user.id, tab=tab, now=timezone.now()
    )
    try:
        result: Stopped | Refusal = await link.clear(LinkClear(by=user.display_name))
    except LinkRefused as refused:
        await in_database(record_outcome, cleared, user, refused.refusal)
        raise
    await in_database(record_outcome, cleared, user, result)


def press_once(robot_id: UUID, address: LinkAddress, *, user: User, through: str) -> Stopped | Refusal:
    """Stop a robot from where there is no event loop, over a connection of its own."""
    try:
        result: Stopped | Refusal = stop_once(address, user.display_name)
    except LinkRefused as refused:
        result = refused.refusal
    record_outcome(record_press(robot_id, user, through), user, result)
    return result


def record_press(robot_id: UUID, user: User, through: str) -> Record | None:
    """Record that a stop was pressed; None if that was not possible, which stops nothing."""
    try:
        return audit.record("stop.press", actor=user, robot_id=robot_id, parameters={"through": through})
    except audit.AuditUnavailable as error:
        log.error("a stop of robot %s by %s was sent, but not recorded: %s", robot_id, user.pk, error)
        return None


def record_outcome(record: Record | None, user: User, result: Stopped | Refusal) -> None:
    """Record what came of a stop or a clear."""
    if record is None:
        return
    outcome = result.code if isinstance(result, Refusal) else result.stop.state
    parameters = {"text": result.text} if isinstance(result, Refusal) else {}
    try:
        audit.record(record.kind, actor=user, of=record, outcome=outcome, parameters=parameters)
    except audit.AuditUnavailable as error:
        log.error("the outcome %s of record %s was not recorded: %s", outcome, record.pk, error)
