"""Emergency stop: sent first, told as soon as the bridge answers, recorded beside. It waits for no database.

Every press is sent; of presses again and again few are recorded (`teleop.recording.repeat_suppression`).
"""

from __future__ import annotations

import asyncio
import atexit
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple
from uuid import UUID, uuid4

import msgspec
from django.db import DatabaseError, close_old_connections
from django.utils import timezone
from msgspec import structs

from fleet.accounts.models import User
from robots.link.client import BridgeLink, LinkRefused
from robots.registry.models import Robot
from robots.stop.delivery import stop_message
from robots.stop.presses import Pending, Result, keep_pending, press_all, record_outcome, record_press
from robots.wire import LinkClear, Refusal, Stopped
from teleop.background.database import in_database, in_database_background
from teleop.background.tasks import run_in_background
from teleop.control.rules import Tab
from teleop.control.selectors import lease_of
from teleop.control.services import clear_authorize
from teleop.recording.repeat_suppression import RepeatSuppressor

GAP_S = 3.0  # between two records of one person's presses of one robot by one door

Key = tuple[UUID, UUID, str, UUID | None]
Outcomes = dict[Robot, Result]


class Press(NamedTuple):
    """A stop, as it goes on record; `answer` is what came of it, in the end."""

    person: User
    through: str  # which door
    robot_id: UUID
    of: UUID | None  # the press that stopped the robot, of which this is that or a repetition
    answer: Future[Result]

    @property
    def key(self) -> Key:
        """What is folded into one."""
        return self.person.pk, self.robot_id, self.through, self.of

    @property
    def gap_s(self) -> float:
        """Between two records of it."""
        return GAP_S

    @property
    def waits(self) -> bool:
        """A press that stopped a robot is written at once. One that is not known to have may be a repetition."""
        return self.of is None


class StopButton:
    """One page's stop of one robot.

    It may be pressed as often as anybody likes: each press is sent at once, but for those of a flood, which are one
    more when the bridge has answered. `failed` is told what the bridge's last answer was if it did not confirm.
    """

    def __init__(self, user: User, through: str, failed: Callable[[Refusal], Awaitable[None]]) -> None:
        self._answer: Future[Result] | None = None  # of the press that is not answered yet
        self._again = False
        self._number = 0  # of the newest stop that the bridge confirmed
        self._of: UUID | None = None  # the newest press that was no repetition
        self._user = user
        self._through = through
        self._failed = failed

    def press(self, link: BridgeLink, *, flood: bool = False) -> None:
        """Stop the robot behind `link`."""
        if self._is_cleared(link):
            self._of = uuid4()
        if self._answer is None:
            self._answer = self._begin(link)
        elif flood or not link.send(stop_message(link.robot_id, self._user.display_name, press=uuid4())):
            self._again = True  # without a link, the way round it is being tried: once more, when it was
        pressed = Press(self._user, self._through, link.robot_id, self._of, self._answer)
        asyncio.get_running_loop().call_soon(log.note, pressed)  # after it was sent

    def _is_cleared(self, link: BridgeLink) -> bool:
        """Whether a press now is no repetition. The state may be older than the last press; its number tells."""
        if self._answer is not None or link.state is None:
            return False
        stop = link.state.stop
        return stop.state == "clear" and stop.number >= self._number

    def _begin(self, link: BridgeLink) -> Future[Result]:
        answer: Future[Result] = Future()
        run_in_background(self._send(link, answer))
        return answer

    async def _send(self, link: BridgeLink, answer: Future[Result]) -> None:
        try:
            result = await _send(link, self._user.display_name)
            if isinstance(result, Stopped):
                self._number = result.stop.number
            answer.set_result(result)
        finally:
            again, self._again = self._again, False
            self._answer = self._begin(link) if again else None
        if again:
            return
        if isinstance(result, Pending):
            await self._failed(result.refusal)
        elif isinstance(result, Refusal):
            text = f"{result.text} Use the red button on the robot."
            await self._failed(structs.replace(result, text=text))


async def _send(link: BridgeLink, by: str) -> Result:
    stop = stop_message(link.robot_id, by, press=uuid4())
    try:
        return await link.stop(stop)
    except LinkRefused as refused:
        return await asyncio.to_thread(keep_pending, link.robot_id, link.address, stop, refused)


def put_on_record(last: Press, times: int) -> None:
    """Record so many presses, with the control session that they interrupt; beside, what came of the last."""
    try:
        _record(last, times)
    finally:
        close_old_connections()


def _record(last: Press, times: int) -> None:
    try:
        close_old_connections()
        held = lease_of(last.robot_id)
    except DatabaseError:
        held = None
    pressed = record_press(
        last.robot_id,
        actor=last.person,
        through=last.through,
        session_id=held.session if held else None,
        fence=held.fence if held else None,
        times=times,
    )

    def answered(answer: Future[Any]) -> None:
        in_database_background(told, answer.result())

    def told(result: Result) -> None:
        record_outcome(pressed, actor=last.person, result=result)
        if isinstance(result, Pending):
            result.outcome.add_done_callback(answered)

    if last.answer.done():
        told(last.answer.result())
    else:
        last.answer.add_done_callback(answered)


log = RepeatSuppressor(put_on_record, most=None)  # keys are people, robots and doors: nobody chooses them
atexit.register(log.flush)


async def clear(link: BridgeLink, number: int, *, user: User, tab: Tab | None) -> None:
    """Release the latch of stop `number`, if this person may and it can be recorded.

    Raises ControlRefused or LinkRefused.
    """
    cleared = await in_database(
        clear_authorize, robot_id=link.robot_id, user_id=user.id, tab=tab, now=timezone.now()
    )
    try:
        result: Result = await link.clear(LinkClear(by=user.display_name, number=number))
    except LinkRefused as refused:
        await in_database(record_outcome, cleared, actor=user, result=refused.refusal)
        raise
    await in_database(record_outcome, cleared, actor=user, result=result)


def press_once(robots: Sequence[Robot], *, user: User, through: str) -> Outcomes:
    """Stop robots from where there is no event loop, all at once, each over a connection of its own."""
    results = press_all(robots, user.display_name)
    for robot, result in zip(robots, results, strict=True):
        answer: Future[Result] = Future()
        answer.set_result(result)
        log.note(Press(user, through, robot.id, None, answer))
    return dict(zip(robots, results, strict=True))


def told(outcomes: Outcomes) -> tuple[dict[str, Any], int]:
    """As HTTP tells it: by slug, and the status: 200 confirmed, 202 not by every robot yet, 502 refused by one."""
    by_slug = {robot.slug: _told(result) for robot, result in outcomes.items()}
    if any(isinstance(result, Refusal) for result in outcomes.values()):
        return by_slug, 502
    return by_slug, 202 if any(isinstance(result, Pending) for result in outcomes.values()) else 200


def _told(result: Result) -> dict[str, Any]:
    pending = isinstance(result, Pending)
    told: dict[str, Any] = msgspec.to_builtins(result.refusal if isinstance(result, Pending) else result)
    return {**told, "pending": True} if pending else told
