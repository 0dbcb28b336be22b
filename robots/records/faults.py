"""Records the beginning and the end of faults of robots, each once.

A fault belongs to a part: the bridge (reported by the fleet supervisor) or the robot (reported by its bridge). While a
part has a fault, further faults of this part count as the same fault.
"""

from __future__ import annotations

import logging
import threading
from concurrent.futures import Future
from typing import NamedTuple
from uuid import UUID

from django.db import transaction
from django.utils import timezone

from fleet.audit.models import Record
from fleet.audit.services import lock_chain, record
from robots.link.connections import LinkRefused
from robots.link.state_reader import state_once
from robots.registry.models import BridgeStatus, Robot
from robots.registry.selectors import link_address
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.sentences import say

log = logging.getLogger(__name__)

BRIDGE, ROBOT = "bridge", "robot"  # parts
CHECK_S = 5.0  # between two checks of the robots
SURE_AFTER = 3  # checks in a row with a fault, because a restarting bridge is no fault

State = BridgeStatus.State
_BRIDGE_FAULTS = {State.BACKING_OFF: "bridge_ended", State.REFUSED: "bridge_refused"}
_BRIDGE_WELL = {State.RUNNING, State.DISABLED}


class Condition(NamedTuple):
    """State of a part."""

    fault: str = ""  # code of the fault; "": the part is well
    words: str = ""


def record_bridge(robot_id: UUID, state: State, detail: str) -> None:
    """Record a fault, or its end, if the new state of the bridge's process shows one; a start or an end is no fault."""
    if state in _BRIDGE_FAULTS:
        record_part(robot_id, BRIDGE, Condition(_BRIDGE_FAULTS[state], detail))
    elif state in _BRIDGE_WELL:
        record_part(robot_id, BRIDGE, Condition())


@transaction.atomic
def record_part(robot_id: UUID, part: str, now: Condition) -> None:
    """Record the beginning or end of a part's fault, unless it is recorded already."""
    name = Robot.objects.filter(pk=robot_id).values_list("name", flat=True).first()
    if name is None:
        return
    lock_chain(robot_id, name)
    last = _last(robot_id, part)
    is_open = last is not None and last.of_id is None
    if now.fault and not is_open:
        parameters = {"part": part}
        record(
            "fault",
            robot_id=robot_id,
            robot_name=name,
            outcome=now.fault,
            parameters=parameters,
            private={"words": now.words},
        )
    elif last is not None and is_open and not now.fault:
        duration_s = round((timezone.now() - last.at).total_seconds(), 1)
        record("fault", of=last, outcome="over", parameters={"part": part, "duration_s": duration_s})


def is_offline(robot_id: UUID) -> bool:
    """Return whether the robot has a fault that is not over: nobody can drive it."""
    last = _last(robot_id, ROBOT)
    return last is not None and last.of_id is None


def _last(robot_id: UUID, part: str) -> Record | None:
    """Return the last record of a part's faults: the begin of one, or its end, which names its begin."""
    return (
        Record.objects.filter(robot_id=robot_id, kind="fault", parameters__part=part).order_by("-id").first()
    )


class RobotWatch:
    """Asks each robot's bridge for the robot's state every `CHECK_S`. Only the housekeeping process uses this."""

    def __init__(self) -> None:
        self._asked: dict[UUID, Future[Condition]] = {}
        self._unwell: dict[UUID, int] = {}  # number of checks in a row with a fault
        self._recorded: dict[UUID, bool] = {}  # whether the robot had a fault when it was last recorded
        self._next_s = 0.0

    def step(self, now_s: float) -> None:
        """Record the answers that have arrived, and ask again if it is time (s, monotonic). Waits for no robot."""
        for robot_id, answer in list(self._asked.items()):
            if answer.done():
                self._note(robot_id, answer.result())
                del self._asked[robot_id]
        if now_s >= self._next_s:
            self._next_s = now_s + CHECK_S
            for robot in Robot.objects.filter(enabled=True).select_related("profile"):
                if robot.id not in self._asked:
                    self._asked[robot.id] = _ask(robot.id, link_address(robot))

    def _note(self, robot_id: UUID, now: Condition) -> None:
        self._unwell[robot_id] = self._unwell.get(robot_id, 0) + 1 if now.fault else 0
        if now.fault and self._unwell[robot_id] < SURE_AFTER:
            return
        at_fault = bool(now.fault)
        if self._recorded.get(robot_id) != at_fault:
            record_part(robot_id, ROBOT, now)
            self._recorded[robot_id] = at_fault


def _ask(robot_id: UUID, address: LinkAddress) -> Future[Condition]:
    """Ask in a daemon thread, so that the process can end without waiting for the answer."""
    answer: Future[Condition] = Future()

    def ask() -> None:
        try:
            answer.set_result(condition_of(robot_id, address))
        except Exception:  # any fault: the robot is asked again
            log.exception("a robot could not be asked how it is")
            answer.set_result(Condition("link_fault", say("The server failed to ask the robot’s bridge.")))

    threading.Thread(target=ask, name="robot", daemon=True).start()
    return answer


def condition_of(robot_id: UUID, address: LinkAddress) -> Condition:
    """Ask the robot's bridge, and return the robot's condition."""
    try:
        state = state_once(robot_id, address)
    except LinkRefused as refused:
        return Condition(refused.refusal.code, refused.refusal.sentence)
    return Condition() if state.phase == "online" else Condition("robot_offline", state.text)
