"""Moving obstacles (docs/gate.md, 10): points that stand where the scan of 0.4 s ago saw free space.

If a place that was free is occupied now, something came. Changes by the robot's own motion, at edges and by
occlusion prove nothing and are ignored. The speed is computed from the distance between an object that
vanished and the object that appeared. Everything is in the odometry frame; times are the robot's own stamps.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry.planar import NO_POINTS, ORIGIN, Points, chosen, placed, relative_to, wrapped
from robots.bridge.gate.obstacles.sightings import seen_free, sight
from robots.bridge.gate.sensing.scan import Sweep
from robots.bridge.gate.values import Pose

MOVER = "mover"

LOOK_BACK_S = 0.4
OLDEST_LOOK_S = 0.6
LEAST_POINTS = 3
NEAR_M = 5.0  # an object farther from the sensor cannot reach the robot before it stands
APART_M = 0.20  # between two neighbouring points of different objects
LARGEST_M = 1.0  # a wider object is no person: only newly appeared parts count
LEAST_MPS = 0.2
MOST_MPS = 2.0
SLACK_M = 0.15  # error of an object's middle: another part of it may be visible now
SAME_M = 0.15  # a point this near to one of a mover moves with it
TOLERANCE_RAD = 0.012  # error of the odometry's yaw within 0.4 s
SWEEP_S = 0.03  # the ends of a scan are this much older or younger than its middle, which matters in a turn

Flags = NDArray[np.bool_]


class _Look:
    """One scan: pose of the sensor, and points."""

    def __init__(self, stamp_s: float, sensor: Pose, sweep: Sweep, hit: Callable[[], Points]) -> None:
        self.stamp_s = stamp_s
        self.sensor = sensor
        self.sweep = sweep
        self._hit = hit

    @cached_property
    def points(self) -> Points:
        """Near hits of the scan, in the order of its beams."""
        points = self._hit()
        x, y = points.T
        near = np.flatnonzero(np.hypot(x - self.sensor.x, y - self.sensor.y) < NEAR_M)
        return points.T[:, near].T


class _Mover(NamedTuple):
    points: Points
    velocity: tuple[float, float]


class _Thing(NamedTuple):
    """The rows of the points of an object, and their middle."""

    rows: NDArray[np.intp]
    middle: NDArray[np.float64]


class Movers:
    """Moving obstacles by the scans of one laser."""

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque()
        self._found: list[_Mover] | None = []  # None: not computed for the newest scan yet
        self._frame = 0

    @property
    def any(self) -> bool:
        """Return whether anything moves."""
        return bool(self._movers)

    @property
    def _movers(self) -> list[_Mover]:
        """The movers of the newest scan, computed once per scan, and only while somebody drives."""
        if self._found is None:
            then, now = self._looks[0], self._looks[-1]
            known = LOOK_BACK_S / 2.0 <= now.stamp_s - then.stamp_s <= OLDEST_LOOK_S
            self._found = list(_movers(then, now)) if known else []
        return self._found

    def observe(
        self, points: Callable[[], Points], sweep: Sweep, sensor: Pose, stamp_s: float, frame: int = 0
    ) -> None:
        """Take a scan; `points` in the order of its beams, computed on demand, from a sensor at `sensor`.

        A new `frame` means that the odometry has jumped: earlier observations are then useless.
        """
        if frame != self._frame or (self._looks and stamp_s <= self._looks[-1].stamp_s):
            self._looks.clear()
            self._frame = frame
        self._looks.append(_Look(stamp_s, sensor, sweep, points))
        while len(self._looks) > 1 and stamp_s - self._looks[1].stamp_s >= LOOK_BACK_S - 1e-3:
            self._looks.popleft()
        self._found = None

    def forget(self) -> None:
        """Forget all earlier scans."""
        self._looks.clear()
        self._found = []

    def drift(self, points: Points) -> Points:
        """Return the velocity (m/s) of each point; 0 if it belongs to no mover."""
        drift = np.zeros_like(points)
        for mover in self._movers:
            (left, low), (right, high) = mover.points.min(axis=0) - SAME_M, mover.points.max(axis=0) + SAME_M
            x, y = points.T
            about = np.flatnonzero((x > left) & (x < right) & (y > low) & (y < high))
            apart = points[about, None] - mover.points
            drift[about[np.hypot(*apart.T).min(axis=0) < SAME_M]] = mover.velocity
        return drift


def _movers(then: _Look, now: _Look) -> Iterator[_Mover]:
    """Return the objects that appeared, each with its velocity from the place of an earlier object."""
    appeared = _seen_through(then, now, now.points)
    if np.count_nonzero(appeared) < LEAST_POINTS:
        return
    vanished = _seen_through(now, then, then.points)
    hidden = ~sight(now.sweep, _seen_by(now.sensor, then.points)).judged
    gone, covered = list(_things(then.points, vanished)), list(_things(then.points, hidden))
    passed_s = now.stamp_s - then.stamp_s
    for thing in _things(now.points, appeared):
        # A person who walks straight towards the laser hides their earlier place: check hidden places only if
        # nothing vanished.
        velocity = _velocity(thing, gone, passed_s) or _velocity(thing, covered, passed_s)
        if velocity is not None:
            yield _Mover(now.points[thing.rows], velocity)


def _velocity(thing: _Thing, before: list[_Thing], passed_s: float) -> tuple[float, float] | None:
    """Return the velocity from the nearest earlier object; None if it is too far away, or hardly moved."""
    shifts = [thing.middle - other.middle for other in before]
    shift = min(shifts, key=lambda shift: math.hypot(*shift), default=None)
    if shift is None or math.hypot(*shift) > MOST_MPS * passed_s + SLACK_M:
        return None
    speed = math.hypot(*shift) / passed_s
    if speed < LEAST_MPS:
        return None
    vx, vy = shift / passed_s * min(1.0, MOST_MPS / speed)
    return float(vx), float(vy)


def _things(points: Points, marked: Flags) -> Iterator[_Thing]:
    """Return the objects with enough marked points; of a too large object, only the marked points."""
    if not len(points):
        return
    steps = np.hypot(*np.diff(points, axis=0).T)
    starts = np.concatenate(([0], np.flatnonzero(steps > APART_M) + 1, [len(points)]))
    counts = np.add.reduceat(marked, starts[:-1], dtype=np.intp)
    for n in np.flatnonzero(counts >= LEAST_POINTS):
        rows = np.arange(starts[n], starts[n + 1])
        if np.hypot(*np.ptp(points[rows], axis=0)) > LARGEST_M:
            rows = rows[marked[rows]]
        yield _Thing(rows, points[rows].mean(axis=0))


def _seen_through(observer: _Look, other: _Look, places: Points) -> Flags:
    """Return at which `places` of the other scan the observer saw free space, whatever the yaw's error is."""
    passed_s = abs(other.stamp_s - observer.stamp_s)
    turned = abs(wrapped(other.sensor.yaw - observer.sensor.yaw))
    tolerance = TOLERANCE_RAD + SWEEP_S * turned / passed_s
    rows = np.arange(len(places))  # points that passed all checks so far: few standing points pass the first
    for aside in (0.0, -tolerance, tolerance):
        sensor = observer.sensor._replace(yaw=observer.sensor.yaw + aside)
        rows = rows[seen_free(observer.sweep, _seen_by(sensor, chosen(places, rows)))]
    through = np.zeros(len(places), dtype=np.bool_)
    through[rows] = True
    return through


def _seen_by(sensor: Pose, places: Points) -> Points:
    """Return places in the frame of a sensor."""
    return placed(places, relative_to(ORIGIN, sensor)) if len(places) else NO_POINTS
