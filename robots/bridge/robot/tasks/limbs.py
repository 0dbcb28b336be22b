"""Gripper and torso: goals of their controllers, and what these report."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from robots.bridge.limbs.limb_move import LimbMove, LimbMover
from robots.bridge.robot.incoming.mailboxes import EVENTS_WAIT, Mailboxes
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.shared.configuration.bridge_config import LimbSource
from robots.shared.texts import SENTENCE, cut
from robots.shared.wire import Limb


class LimbAction(Protocol):
    """The action of one limb. What it reports goes to `LimbReports`."""

    @property
    def heard(self) -> bool:
        """Whether a node of the robot takes goals."""

    def move(self, goal_id: str, to_m: float, seconds: float) -> None:
        """Send a goal: all joints move equally. The goal of a gripper's own controller has no duration."""

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""


class LimbReports:
    """Reports of one limb's action, from the threads of the side to `move` on the event loop."""

    def __init__(self, source: LimbSource, mail: Mailboxes, move: LimbMove) -> None:
        self._source = source
        self._mail = mail
        self._move = move

    def running(self, active: Mapping[str, bool]) -> None:
        """Take the running goals of all senders, and whether each has begun."""
        self._mail.post(
            (self._source.action, "goals"),
            lambda: self._move.running(active, time.monotonic()),
            can_wait=True,
        )

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Report the end of a goal, with the controller's text. A gripper may have stalled, also if it succeeded.

        A rejected goal, or one whose result is lost, may have none (None).
        """
        said = text
        if result is not None and self._source.is_command:
            has_stalled = result.stalled and not result.reached_goal
            if has_stalled and outcome in {"succeeded", "failed"}:
                outcome = "stalled"
        elif result is not None:
            said = text or cut(result.error_string, SENTENCE)
        self._mail.post(
            (self._source.action, "ended"),
            lambda: self._move.ended(goal_id, outcome, said, time.monotonic()),
            EVENTS_WAIT,
        )


class Limbs(LimbMover, RobotPart):
    """The limbs of one robot. `connect` connects the action of one."""

    def __init__(self, node: Node, connect: Callable[[LimbSource, LimbReports], LimbAction]) -> None:
        self._node = node
        self._sources = node.config.topics.limbs
        self._actions = {
            limb: connect(source, LimbReports(source, node.mail, node.tasks.limbs.move(limb)))
            for limb, source in self._sources.items()
        }

    def limb_at(self, limb: Limb) -> float | None:
        places = [self._node.joint(name) for name in self._sources[limb].joints]
        known = [place for place in places if place is not None]
        return sum(known) if len(known) == len(places) else None

    def limb_has_listener(self, limb: Limb) -> bool:
        return self._actions[limb].heard

    def move_limb(self, limb: Limb, goal_id: str, to_m: float, seconds: float) -> None:
        self._actions[limb].move(goal_id, to_m, seconds)

    def cancel_limb(self, limb: Limb, goal_id: str) -> None:
        self._actions[limb].cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [action.cancel_all for action in self._actions.values()]
