"""Emergency stop: sent first, told as soon as the bridge answers, recorded beside. It waits for no database."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.link import BridgeLink, LinkRefused
from robots.models import Robot
from robots.stops import press, press_all, record_outcome, record_press
from robots.wire import LinkClear, LinkStop, Refusal, Stopped
from teleop.database import in_database, in_database_beside
from teleop.rules import Tab
from teleop.selectors import holding_of
from teleop.services import clear_begin
from teleop.socket import beside


class StopButton:
    """One page's stop of one robot.

    It may be pressed as often as anybody likes: each press is sent at once. Until the first is answered the others are
    not recorded, and `failed` is told what the bridge's last answer was if it did not confirm.
    """

    def __init__(self, user: User, through: str, failed: Callable[[Refusal], Awaitable[None]]) -> None:
        self.pressed = False  # and not answered yet
        self._again = False
        self._user = user
        self._through = through
        self._failed = failed

    def press(self, link: BridgeLink) -> None:
        """Stop the robot behind `link`."""
        if not self.pressed:
            self.pressed = True
            beside(self._press(link))
        elif not link.send(LinkStop(self._user.display_name)):
            self._again = True  # the way round the link is being tried: once more, when it was

    async def _press(self, link: BridgeLink) -> None:
        answer = asyncio.ensure_future(_send(link, self._user.display_name))
        await asyncio.sleep(0)  # now it is on its way
        beside(_record(link.robot_id, self._user, self._through, answer))
        result = await answer
        while isinstance(result, Refusal) and self._again:
            self._again = False
            result = await _send(link, self._user.display_name)
        self.pressed = self._again = False
        if isinstance(result, Refusal):
            await self._failed(result)


async def _send(link: BridgeLink, by: str) -> Stopped | Refusal:
    try:
        return await link.stop(LinkStop(by=by))
    except LinkRefused:
        # The link may be waiting before its next attempt: a stop makes its own.
        return await asyncio.to_thread(press, link.robot_id, link.address, by)


async def _record(
    robot_id: UUID, user: User, through: str, answer: asyncio.Future[Stopped | Refusal]
) -> None:
    pressed = await in_database(_record_press, robot_id, user, through)
    await in_database(record_outcome, pressed, actor=user, result=await answer)


def _record_press(robot_id: UUID, user: User, through: str) -> Record | None:
    """Record a stop, with the control session that it interrupts, as far as the database knows it."""
    try:
        held = holding_of(robot_id)
    except DatabaseError:
        held = None
    session, fence = (held.session, held.fence) if held else (None, None)
    return record_press(robot_id, actor=user, through=through, session_id=session, fence=fence)


async def clear(link: BridgeLink, number: int, *, user: User, tab: Tab | None) -> None:
    """Release the latch of stop `number`, if this person may and it can be recorded.

    Raises ControlRefused or LinkRefused.
    """
    cleared = await in_database(
        clear_begin, robot_id=link.robot_id, user_id=user.id, tab=tab, now=timezone.now()
    )
    try:
        result: Stopped | Refusal = await link.clear(LinkClear(by=user.display_name, number=number))
    except LinkRefused as refused:
        await in_database(record_outcome, cleared, actor=user, result=refused.refusal)
        raise
    await in_database(record_outcome, cleared, actor=user, result=result)


def press_once(robots: Sequence[Robot], *, user: User, through: str) -> list[Stopped | Refusal]:
    """Stop robots from where there is no event loop, all at once, each over a connection of its own."""
    results = press_all(robots, user.display_name)
    for robot, result in zip(robots, results, strict=True):
        in_database_beside(_record_both, robot.id, user, through, result)
    return results


def _record_both(robot_id: UUID, user: User, through: str, result: Stopped | Refusal) -> None:
    pressed = _record_press(robot_id, user, through)
    record_outcome(pressed, actor=user, result=result)
