"""Emergency stop: sent first, recorded after. It is never refused, and waits for no database."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone

from fleet import audit
from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.bridge.config import LinkAddress
from robots.link import BridgeLink, LinkRefused, stop_once
from robots.models import Robot
from robots.selectors import link_address
from robots.wire import LinkClear, LinkStop, Refusal, Stopped
from teleop.database import in_database
from teleop.rules import Tab
from teleop.services import clear_begin

log = logging.getLogger(__name__)


async def press(link: BridgeLink, *, user: User, through: str) -> Stopped | Refusal:
    """Stop the robot behind `link`; returns the latch, or why the bridge did not confirm it."""
    answer = asyncio.ensure_future(_send(link, user.display_name))
    await asyncio.sleep(0)  # now it is on its way
    pressed = await in_database(record_press, link.robot_id, user, through)
    result = await answer
    await in_database(record_outcome, pressed, user, result)
    return result


async def _send(link: BridgeLink, by: str) -> Stopped | Refusal:
    try:
        return await link.stop(LinkStop(by=by))
    except LinkRefused:
        # The link may be waiting before its next attempt: a stop makes its own.
        return await asyncio.to_thread(_send_once, link.address, by)


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


def press_once(robots: Sequence[Robot], *, user: User, through: str) -> list[Stopped | Refusal]:
    """Stop robots from where there is no event loop, all at once, each over a connection of its own."""
    with ThreadPoolExecutor(max(len(robots), 1)) as threads:
        results = list(threads.map(lambda robot: _send_once(link_address(robot), user.display_name), robots))
    for robot, result in zip(robots, results, strict=True):
        record_outcome(record_press(robot.id, user, through), user, result)
    return results


def _send_once(address: LinkAddress, by: str) -> Stopped | Refusal:
    try:
        return stop_once(address, by)
    except LinkRefused as refused:
        return refused.refusal


def record_press(robot_id: UUID, user: User, through: str) -> Record | None:
    """Record that a stop was pressed; None if that was not possible, which stops nothing."""
    try:
        name = Robot.objects.values_list("name", flat=True).get(pk=robot_id)
        return audit.record(
            "stop.press", actor=user, robot_id=robot_id, robot_name=name, parameters={"through": through}
        )
    except (audit.AuditUnavailable, DatabaseError) as error:
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
