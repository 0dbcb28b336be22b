"""Emergency stop: sent first, recorded after. It is never refused, and waits for no database."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from django.utils import timezone

from fleet.accounts.models import User
from robots.bridge.config import LinkAddress
from robots.link import BridgeLink, LinkRefused, stop_once
from robots.models import Robot
from robots.selectors import link_address
from robots.stops import record_outcome, record_press
from robots.wire import LinkClear, LinkStop, Refusal, Stopped
from teleop.database import in_database
from teleop.rules import Tab
from teleop.services import clear_begin


async def press(link: BridgeLink, *, user: User, through: str) -> Stopped | Refusal:
    """Stop the robot behind `link`; returns the latch, or why the bridge did not confirm it."""
    answer = asyncio.ensure_future(_send(link, user.display_name))
    await asyncio.sleep(0)  # now it is on its way
    pressed = await in_database(record_press, link.robot_id, actor=user, parameters={"through": through})
    result = await answer
    await in_database(record_outcome, pressed, actor=user, result=result)
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
        await in_database(record_outcome, cleared, actor=user, result=refused.refusal)
        raise
    await in_database(record_outcome, cleared, actor=user, result=result)


def press_once(robots: Sequence[Robot], *, user: User, through: str) -> list[Stopped | Refusal]:
    """Stop robots from where there is no event loop, all at once, each over a connection of its own."""
    with ThreadPoolExecutor(max(len(robots), 1)) as threads:
        results = list(threads.map(lambda robot: _send_once(link_address(robot), user.display_name), robots))
    for robot, result in zip(robots, results, strict=True):
        pressed = record_press(robot.id, actor=user, parameters={"through": through})
        record_outcome(pressed, actor=user, result=result)
    return results


def _send_once(address: LinkAddress, by: str) -> Stopped | Refusal:
    try:
        return stop_once(address, by)
    except LinkRefused as refused:
        return refused.refusal
