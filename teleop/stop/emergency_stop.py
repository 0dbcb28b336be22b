"""Emergency stop: sent first, reported when the bridge answers, recorded in the background.

A stop never waits for the database.

Every press is sent. Repeated presses share records (`teleop.records.repeat_suppression`).
"""

from __future__ import annotations

import asyncio
import atexit
import time
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple
from uuid import UUID, uuid4

from django.db import DatabaseError, close_old_connections
from django.utils import timezone
from msgspec import structs

from fleet.accounts.models import User
from robots.link.client import BridgeLink, LinkRefused, links
from robots.link.stop_delivery import stop_message
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared import wire
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.sentences import say
from robots.shared.wire import LinkClear, Refusal, Stopped
from teleop.background.database import in_database, in_database_background
from teleop.background.jobs import run_in_background
from teleop.control.lease_checks import Tab
from teleop.control.selectors import lease_of
from teleop.control.services import clear_authorize
from teleop.records.repeat_suppression import RepeatSuppressor
from teleop.stop.presses import Pending, Result, keep_pending, press_all, record_outcome, record_press

PACE_S = 0.05  # between two presses for one robot that wait for their answers
# Presses of one person's pages that are sent while another has no answer yet
REPEATS_PER_S, REPEATS_BURST = 20.0, 40.0
GAP_S = 3.0  # between two records of one person's presses for one robot through one interface

Key = tuple[UUID, UUID, str, UUID | None]
Outcomes = dict[Robot, Result]


class Press(NamedTuple):
    """A press of a stop button that must be recorded. `answer` gets the result later."""

    person: User
    through: str  # interface: robot page, fleet page, page, rest
    robot_id: UUID
    # The press that stopped the robot: this one, or the earlier press that this one repeats; None: not known.
    first_press: UUID | None
    answer: Future[Result]

    @property
    def key(self) -> Key:
        """Presses with the same key are repeats."""
        return self.person.pk, self.robot_id, self.through, self.first_press

    @property
    def gap_s(self) -> float:
        """Seconds between two records of repeats."""
        return GAP_S

    @property
    def deferrable(self) -> bool:
        """Return whether the record may wait: a press that stopped a robot is recorded at once, a repeat is not."""
        return self.first_press is None


class SharedPresses:
    """Sends presses. Of each robot one is under way at a time, and `PACE_S` are between the beginnings of two.

    Presses of all people that arrive meanwhile share the next one. It is sent when the one before has its answer: so it
    also stops a robot that somebody cleared in between. Thus hundreds of presses cost a bridge no more than one person.
    """

    def __init__(self) -> None:
        self._under_way: set[UUID] = set()
        self._next: dict[UUID, tuple[BridgeLink, User, asyncio.Future[Result]]] = {}
        self._budgets: dict[UUID, TokenBucket] = {}

    def send(self, link: BridgeLink, user: User) -> asyncio.Future[Result]:
        """Stop the robot behind `link`. Shield the result: others wait for it, too."""
        answer: asyncio.Future[Result]
        if link.robot_id in self._next:
            _link, _user, answer = self._next[link.robot_id]
            return answer
        answer = asyncio.get_running_loop().create_future()
        if link.robot_id in self._under_way:
            self._next[link.robot_id] = link, user, answer
        else:
            self._under_way.add(link.robot_id)
            run_in_background(self._send(link, user, answer))
        return answer

    def repeat(self, link: BridgeLink, user: User) -> bool:
        """Send one more press without waiting. False: no link, or too many by this person."""
        budget = self._budgets.setdefault(user.pk, TokenBucket(REPEATS_PER_S, REPEATS_BURST))
        if not budget.spend(time.monotonic()):
            return False
        return link.send(stop_message(link.robot_id, user.display_name, press=uuid4()))

    async def _send(self, link: BridgeLink, user: User, answer: asyncio.Future[Result]) -> None:
        pace = asyncio.ensure_future(asyncio.sleep(PACE_S))
        try:
            answer.set_result(await _send(link, user.display_name))
        finally:
            if not answer.done():
                answer.set_exception(RuntimeError("The stop could not be sent."))
            await pace
            following = self._next.pop(link.robot_id, None)
            if following is None:
                self._under_way.discard(link.robot_id)
            else:
                run_in_background(self._send(*following))


presses = SharedPresses()


class StopButton:
    """One page's stop button for one robot.

    Each press is sent at once, except presses beyond the flood limits: one more press is sent for all of them
    after the bridge has answered. `failed` is called with a refusal if the bridge did not confirm the last
    press.
    """

    def __init__(self, user: User, through: str, failed: Callable[[Refusal], Awaitable[None]]) -> None:
        self._answer: Future[Result] | None = None  # of the press that has no answer yet
        self._again = False
        self._number = 0  # of the newest stop that the bridge confirmed
        self._first_press: UUID | None = None  # the newest press that was no repeat
        self._user = user
        self._through = through
        self._failed = failed

    def press(self, link: BridgeLink, *, flood: bool = False) -> Future[Result]:
        """Stop the robot behind `link`. Return its answer, or that of an earlier press."""
        if self._is_cleared(link):
            self._first_press = uuid4()
        if self._answer is None:
            self._answer = self._begin(link)
        elif flood or not presses.repeat(link, self._user):
            self._again = True  # flood, or no link: press once more after the running press has its answer
        pressed = Press(self._user, self._through, link.robot_id, self._first_press, self._answer)
        asyncio.get_running_loop().call_soon(press_records.add, pressed)  # only after the press is sent
        return self._answer

    def _is_cleared(self, link: BridgeLink) -> bool:
        """Return whether the robot is not stopped, so that a press now is no repeat.

        If the state's stop number is lower than the last one, the state is older than the last press.
        """
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
            result = await asyncio.shield(presses.send(link, self._user))
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
            text = say("{why} Use the red button on the robot.", why=result.sentence)
            await self._failed(structs.replace(result, text=text))


async def _send(link: BridgeLink, by: str) -> Result:
    stop = stop_message(link.robot_id, by, press=uuid4())
    try:
        return await link.stop(stop)
    except LinkRefused as refused:
        return await asyncio.to_thread(keep_pending, link.robot_id, link.address, stop, refused)


def write_record(last: Press, times: int) -> None:
    """Record `times` presses and the control session that they interrupt; later, record the last press's result."""
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

    def on_answer(answer: Future[Any]) -> None:
        in_database_background(record_result, answer.result())

    def record_result(result: Result) -> None:
        record_outcome(pressed, actor=last.person, result=result)
        if isinstance(result, Pending):
            result.outcome.add_done_callback(on_answer)

    if last.answer.done():
        record_result(last.answer.result())
    else:
        last.answer.add_done_callback(on_answer)


# No limit, because people cannot choose these keys (person, robot, interface).
press_records = RepeatSuppressor(write_record, most=None)
atexit.register(press_records.flush)


async def clear(link: BridgeLink, number: int, *, user: User, tab: Tab | None) -> None:
    """Clear stop `number`, after checking and recording that this person may clear it.

    Raises ControlRefused or LinkRefused.
    """
    asked_at = timezone.now()
    cleared = await in_database(
        clear_authorize, robot_id=link.robot_id, user_id=user.id, tab=tab, now=asked_at
    )
    try:
        result: Result = await link.clear(
            LinkClear(by=user.display_name, number=number), asked_at.timestamp()
        )
    except LinkRefused as refused:
        await in_database(record_outcome, cleared, actor=user, result=refused.refusal)
        raise
    await in_database(record_outcome, cleared, actor=user, result=result)


def press_once(robots: Sequence[Robot], *, user: User, through: str) -> Outcomes:
    """Stop robots in parallel, each over a new connection: for code without an event loop."""
    results = press_all(robots, user.display_name)
    _record_all(robots, results, user, through)
    return dict(zip(robots, results, strict=True))


async def press_shared(robots: Sequence[Robot], *, user: User, through: str) -> Outcomes:
    """Stop robots in parallel, over the links of this process."""
    pressed = [presses.send(links.get(robot.id, link_address(robot)), user) for robot in robots]
    results = await asyncio.gather(*map(asyncio.shield, pressed))
    _record_all(robots, results, user, through)
    return dict(zip(robots, results, strict=True))


def _record_all(robots: Sequence[Robot], results: Sequence[Result], user: User, through: str) -> None:
    for robot, result in zip(robots, results, strict=True):
        answer: Future[Result] = Future()
        answer.set_result(result)
        press_records.add(Press(user, through, robot.id, None, answer))


def http_answer(outcomes: Outcomes) -> tuple[dict[str, Any], int]:
    """Return the results by slug and the HTTP status: 200 all confirmed, 202 some pending, 502 one or more refused."""
    by_slug = {robot.slug: _as_json(result) for robot, result in outcomes.items()}
    if any(isinstance(result, Refusal) for result in outcomes.values()):
        return by_slug, 502
    return by_slug, 202 if any(isinstance(result, Pending) for result in outcomes.values()) else 200


def _as_json(result: Result) -> dict[str, Any]:
    pending = isinstance(result, Pending)
    answer: dict[str, Any] = wire.to_builtins(result.refusal if isinstance(result, Pending) else result)
    if isinstance(result, Stopped):
        answer["number"] = result.stop.number  # with which it is cleared
    return {**answer, "pending": True} if pending else answer
