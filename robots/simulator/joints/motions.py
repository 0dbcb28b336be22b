"""Moves the joints, without ROS: recorded motions as play_motion performs them, and trajectories.

Each controller follows one run of points at a time, and joints keep their speed limits: points that need a
higher speed are reached later. A motion that needs a busy controller is refused. A trajectory takes over its
controller; a motion that used this controller fails. A cancelled run stops at its present position.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from enum import Enum, IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct

from robots.simulator.joints.joint_table import HOME, JOINTS
from robots.simulator.physics.base import clamp

# An eased path begins and ends at rest: its highest speed is its average speed times this factor.
EASED_PEAK = 1.5


class ErrorCode(IntEnum):
    """PlayMotionResult's codes that are used here."""

    SUCCEEDED = 1
    MOTION_NOT_FOUND = -1
    CONTROLLER_BUSY = -3
    GOAL_NOT_REACHED = -6


class Point(Struct, frozen=True, forbid_unknown_fields=True):
    """The joint positions at a time."""

    positions: list[float]
    time_from_start: float


class Meta(Struct, frozen=True, forbid_unknown_fields=True):
    """Description for people."""

    name: str
    usage: str
    description: str


class Motion(Struct, frozen=True, forbid_unknown_fields=True):
    """A recorded motion."""

    joints: list[str]
    points: list[Point]
    meta: Meta

    def parameters(self) -> dict[str, Any]:
        """Return the motion as on the robot's parameter server."""
        plain: dict[str, Any] = msgspec.to_builtins(self)
        return plain


def load_motions() -> dict[str, Motion]:
    """Return TIAGo's motions by name."""
    return msgspec.yaml.decode(Path(__file__).with_name("motions.yaml").read_bytes(), type=dict[str, Motion])


class RefusedError(Exception):
    """A motion or a trajectory was refused."""

    def __init__(self, code: IntEnum, text: str) -> None:
        super().__init__(text)
        self.code = code


class Phase(Enum):
    """The state of a run."""

    MOVING = "moving"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"
    REPLACED = "replaced"


class Knot(NamedTuple):
    """All joints of a run at one time."""

    at: float
    positions: Sequence[float]


class Run:
    """Joints that move along points."""

    def __init__(
        self,
        joints: Sequence[str],
        points: Sequence[Point],
        start: Mapping[str, float],
        now: float,
        fails: bool = False,
    ) -> None:
        self.joints = joints
        self.controllers = frozenset(JOINTS[joint].controller for joint in joints)
        self.phase = Phase.MOVING
        self._knots = [Knot(now, [start[joint] for joint in joints])]
        asked = 0.0
        for point in points:
            before = self._knots[-1]
            span = max(point.time_from_start - asked, self._shortest_s(before.positions, point.positions))
            self._knots.append(Knot(before.at + span, point.positions))
            asked = point.time_from_start
        self._times = [knot.at for knot in self._knots]
        self._fails_at = (now + self._knots[-1].at) / 2.0 if fails else None

    def _shortest_s(self, begin: Sequence[float], end: Sequence[float]) -> float:
        """Return the time that the slowest joint needs between two points."""
        ways = zip(self.joints, begin, end, strict=True)
        return max(EASED_PEAK * abs(to - at) / JOINTS[joint].speed for joint, at, to in ways)

    def positions(self, now: float) -> dict[str, float]:
        """Return the joints at `now`; end the run when its time is over."""
        if self._fails_at is not None and now >= self._fails_at:
            self.phase = Phase.FAILED
        elif now >= self._knots[-1].at:
            self.phase = Phase.DONE
        index = min(bisect_right(self._times, now), len(self._knots) - 1)
        before, following = self._knots[index - 1], self._knots[index]
        span = following.at - before.at
        share = 1.0 if span <= 0.0 else min(max((now - before.at) / span, 0.0), 1.0)
        eased = share * share * (3.0 - 2.0 * share)
        pairs = zip(before.positions, following.positions, strict=True)
        values = (begin * (1.0 - eased) + end * eased for begin, end in pairs)
        return dict(zip(self.joints, values, strict=True))


class Player:
    """The robot's joints, and the motions that move them."""

    def __init__(self, motions: Mapping[str, Motion]) -> None:
        self.motions = motions
        self.positions = dict(HOME)
        self.velocities = dict.fromkeys(HOME, 0.0)
        self.stuck = False  # joints stay where they are
        self._stepped_at = -math.inf
        self._running: list[Run] = []

    def start(self, name: str, now: float, fails: bool = False) -> Run:
        """Begin motion `name`, or raise `RefusedError`."""
        motion = self._motion(name)
        run = Run(motion.joints, motion.points, self.positions, now, fails)
        if needed := sorted(self._busy() & run.controllers):
            raise RefusedError(ErrorCode.CONTROLLER_BUSY, f"busy: {', '.join(needed)}")
        self._running.append(run)
        return run

    def is_ready(self, name: str) -> bool:
        """Return whether motion `name` exists and nothing moves its joints."""
        motion = self.motions.get(name)
        return motion is not None and not self._busy() & {JOINTS[joint].controller for joint in motion.joints}

    def follow(self, joints: Sequence[str], points: Sequence[Point], now: float) -> Run:
        """Begin a trajectory, within the joints' limits; it replaces its controller's present run."""
        held = [
            Point(
                [
                    clamp(position, JOINTS[joint].low, JOINTS[joint].high)
                    for joint, position in zip(joints, point.positions, strict=True)
                ],
                point.time_from_start,
            )
            for point in points
        ]
        run = Run(joints, held, self.positions, now)
        self.release(run.controllers)
        self._running.append(run)
        return run

    def release(self, controllers: frozenset[str]) -> None:
        """Stop the runs of these controllers at their present positions."""
        for run in self._running[:]:
            if run.controllers & controllers:
                self._running.remove(run)
                run.phase = Phase.REPLACED

    def cancel(self, run: Run) -> None:
        """Stop `run` at its present position."""
        if run in self._running:
            self._running.remove(run)
            run.phase = Phase.CANCELLED

    def step(self, now: float) -> None:
        """Move the joints of all runs to their positions at `now`."""
        before = dict(self.positions)
        for run in self._running[:]:
            wanted = run.positions(now)
            if not self.stuck:
                self.positions.update(wanted)
            if run.phase is not Phase.MOVING:
                self._running.remove(run)
        passed = now - self._stepped_at
        if passed > 0.0:
            self.velocities = {
                joint: (position - before[joint]) / passed for joint, position in self.positions.items()
            }
        self._stepped_at = now

    def is_there(self, name: str, tolerance: float) -> bool:
        """Return whether the joints are at the motion's last point. Raises `RefusedError`."""
        motion = self._motion(name)
        pairs = zip(motion.joints, motion.points[-1].positions, strict=True)
        return all(abs(self.positions[joint] - end) <= tolerance for joint, end in pairs)

    def _busy(self) -> set[str]:
        """Return the controllers that move joints now."""
        return {controller for run in self._running for controller in run.controllers}

    def _motion(self, name: str) -> Motion:
        try:
            return self.motions[name]
        except KeyError:
            text = f"there is no motion {name!r}"
            raise RefusedError(ErrorCode.MOTION_NOT_FOUND, text) from None
