"""Joint states and goals of the motion server, for the arm's posture, as a side's threads have read them.

Joint states come fifty times a second; ten of them a second are reported as a posture.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.gate.arm.discs import Posture
from robots.shared.texts import NAME, cut

EVERY_S = 0.1  # between two postures

Take = Callable[[Posture, float], None]


class JointReception:
    """Keeps `arm` up to date. `take` gets its posture and the time of arrival; None: the robot has no arm."""

    def __init__(self, arm: ArmPosture, take: Take | None) -> None:
        self._arm = arm
        self._take = take
        self._reported_s = float("-inf")

    def joints(self, positions: Iterable[tuple[str, float]]) -> None:
        """Take the positions (rad or m) of some joints."""
        now_s = time.monotonic()
        self._arm.update(positions, now_s)
        if self._take is not None and now_s - self._reported_s >= EVERY_S:
            self._reported_s = now_s
            self._take(self._arm.posture(now_s), now_s)

    def begun(self, goal_id: str, motion: str) -> None:
        """Take the goal of a motion that somebody has sent."""
        self._arm.goal_began(cut(goal_id, NAME), cut(motion, NAME))

    def ended(self, goal_id: str, succeeded: bool) -> None:
        """Take the end of a motion."""
        self._arm.goal_ended(goal_id, succeeded)
