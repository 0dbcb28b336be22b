"""Sources of obstacle points: laser, sonar, memory, depth camera."""

from __future__ import annotations

import math
from typing import Protocol

from robots.bridge.gate.obstacles.sonar_memory import Reading, SonarMemory
from robots.bridge.gate.sensing import scan
from robots.bridge.gate.sensing.sectors import sector_of
from robots.bridge.gate.timing.freshness import LASER_LATE_S, SONAR_STALE_S, Freshness
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import Kind, LaserScan, Sector, SensorHealth
from robots.shared.configuration.gate_profile import CLOSE_ECHO_M
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import NO_POINTS, Points, placed, wrapped
from robots.shared.geometry.poses import Pose
from robots.shared.sentences import say

# most beams this near to the direction of travel must measure something
LASER_WATCHES_RAD = math.radians(20.0)
SONAR_WATCHES_RAD = math.pi / 3.0  # a sonar whose axis is this near to the direction of travel watches it
# If a close echo lasts while the robot moves or turns this far, it is no obstacle: it moves with the robot.
OWN_ECHO_M, OWN_ECHO_RAD = 0.3, math.pi / 2.0


class Source(Protocol):
    """A source of obstacle points."""

    name: str
    kind: Kind
    word: str  # for the operator: "laser"

    def places(self, trail: Trail, now_s: float) -> Points:
        """Return obstacles (N, 2) in the odometry frame: the same array as long as nothing has changed."""

    def moved_nearer(self, points: Points) -> Points:
        """Return its `points` (base frame of the newest odometry), each moved nearer by its possible error."""

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        """Return its obstacles at their measured places, odometry frame."""

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        """Return the state of its sensor."""


class Laser:
    """A planar laser: its newest scan."""

    kind: Kind = "scan"

    def __init__(self, name: str, word: str, pose: Pose, footprint: Footprint) -> None:
        self.name = name
        self.word = word
        self.freshness = Freshness()
        self.pose = pose
        self.footprint = footprint
        self.sweep: scan.Sweep | None = None  # the newest
        self._seen: Points | None = NO_POINTS  # None: not computed yet
        self._carried: Carried | None = Carried()
        self._complaint = ""
        self._covered: dict[float, bool] = {}  # answers for the newest scan, by direction

    def observe(self, message: LaserScan) -> bool:
        """Take a scan; return whether it is new. A malformed scan is ignored; `health` reports it."""
        try:
            check_times(message.stamp_s, message.arrival_s)
            sweep = scan.Sweep(
                message.ranges,
                message.angle_min,
                message.angle_increment,
                message.range_min_m,
                message.range_max_m,
            )
        except scan.Malformed as error:
            self._complaint = error.args[0]
            return False
        if not self.freshness.advances(message.stamp_s, message.arrival_s):
            return False
        self.sweep = sweep
        self._covered.clear()
        self._seen = self._carried = None
        self._complaint = ""
        return True

    @property
    def seen(self) -> Points:
        """Its points outside the hull, base frame of its stamp."""
        if self._seen is None:
            assert self.sweep is not None  # noqa: S101  (`observe` has set both)
            self._seen = scan.outside_hull(placed(self.sweep.steadied(), self.pose), self.footprint)
        return self._seen

    def measured(self, sweep: scan.Sweep) -> Points:
        """Return the points of a scan like `seen`, but not smoothed."""
        return scan.outside_hull(placed(sweep.points(), self.pose), self.footprint)

    def covers(self, direction: float) -> bool:
        """Return whether the newest scan watches a direction (base frame): a laser may be partly covered."""
        if direction not in self._covered:
            sweep = self.sweep
            covered = sweep is not None and sweep.looks_to(direction - self.pose.yaw, LASER_WATCHES_RAD)
            self._covered[direction] = covered
        return self._covered[direction]

    @property
    def sector(self) -> Sector | None:
        """Its sector around the base; None before the first scan."""
        if self.sweep is None:
            return None
        return sector_of(self.pose, self.sweep.middle - self.sweep.span / 2.0, self.sweep.span)

    def is_paired(self, trail: Trail) -> bool:
        """Return whether the pose at the newest scan is known."""
        stamp_s = self.freshness.stamp_s
        return stamp_s is not None and trail.pose_at(stamp_s) is not None

    def places(self, trail: Trail, now_s: float) -> Points:
        if self._carried is None:
            self._carried = Carried(self.seen, self.freshness.stamp_s)
        return self._carried.places(trail)

    def moved_nearer(self, points: Points) -> Points:
        return points

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        return self.places(trail, now_s)

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        text = self.freshness.silence(LASER_LATE_S, now_s, self._complaint)
        if not text and not self.is_paired(trail):
            text = say("its stamps do not match the odometry’s")
        return SensorHealth(self.name, "scan", not text, self.freshness.age_s(now_s), text)


class Sonar:
    """A range sensor. `memory` keeps its echoes."""

    kind: Kind = "sonar"

    def __init__(self, number: int, name: str, pose: Pose, fov: float, memory: SonarMemory) -> None:
        self.name = name
        self.word: str = say("sonar")
        self.freshness = Freshness()
        self._number = number
        self._pose = pose
        self._fov = fov
        self._memory = memory
        self._range_m: float | None = None
        self._complaint = ""
        self._close_m = math.inf  # the least range since all echoes are close
        self._close_at: Pose | None = None  # pose of the robot at the first close echo
        self._resets = 0  # identifies the odometry frame of that pose
        # why its echo is probably no obstacle, and the remedy; it still counts as an obstacle
        self.own_echo = ""

    def observe(
        self,
        stamp_s: float,
        arrival_s: float,
        range_m: float,
        max_range_m: float,
        trail: Trail,
        *,
        is_placed: bool,
    ) -> None:
        """Take a range. A malformed range is ignored; `health` reports it.

        `is_placed`: the odometry is not silent, so it is known where the robot is.
        """
        try:
            check_times(stamp_s, arrival_s)
            arc = scan.cone_points(range_m, max_range_m, self._pose, self._fov)
        except scan.Malformed as error:
            self._complaint = error.args[0]
            return
        if not self.freshness.advances(stamp_s, arrival_s):
            return
        self._range_m = max(range_m, 0.0) if len(arc) else None
        self._complaint = ""
        base = trail.steadied_at(stamp_s) or trail.newest  # an echo with a wrong stamp still counts
        if base is not None:
            free_m = max(min(range_m, max_range_m), 0.0)
            self._follow_close(free_m if len(arc) else math.inf, base, trail.resets)
            reading = Reading(self._number, self._pose, self._fov, arc, free_m)
            self._memory.hear(reading, base, trail, arrival_s, is_placed=is_placed)

    def _follow_close(self, range_m: float, base: Pose, resets: int) -> None:
        """Check whether a close echo moves with the robot: crosstalk, a cable in the cone, or the robot."""
        if range_m > CLOSE_ECHO_M:
            self._close_m, self._close_at, self.own_echo = math.inf, None, ""
            return
        self._close_m = min(self._close_m, range_m)
        if self._close_at is None or resets != self._resets:
            self._close_at, self._resets = base, resets
        there = self._close_at
        moved_m, turned = math.hypot(base.x - there.x, base.y - there.y), abs(wrapped(base.yaw - there.yaw))
        if self.own_echo or moved_m >= OWN_ECHO_M or turned >= OWN_ECHO_RAD:
            self.own_echo = say(
                "{sensor} reports {range:fine} m wherever the robot goes: clean it, remove objects in front of it, "
                "or remove it from the profile",
                sensor=self.name,
                range=self._close_m,
            )

    @property
    def sector(self) -> Sector:
        """Its sector around the base."""
        return sector_of(self._pose, -self._fov / 2.0, self._fov)

    def watches(self, direction: float) -> bool:
        """Return whether it watches a direction of travel in the base frame."""
        return abs(wrapped(direction - self._pose.yaw)) <= SONAR_WATCHES_RAD

    def range_m(self, now_s: float) -> float | None:
        """Return the newest range in metres; None if nothing is in range or the sonar is silent."""
        return self._range_m if self.freshness.within(SONAR_STALE_S, now_s) else None

    def places(self, trail: Trail, now_s: float) -> Points:
        return self._memory.heard(self._number, trail)

    def moved_nearer(self, points: Points) -> Points:
        return self._memory.moved_nearer(points, self._number)

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        return self.places(trail, now_s)

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        text = self.freshness.silence(SONAR_STALE_S, now_s, self._complaint) or self.own_echo
        return SensorHealth(self.name, "sonar", not text, self.freshness.age_s(now_s), text)


class Carried:
    """Points of one moment, transformed to the odometry frame."""

    def __init__(self, points: Points = NO_POINTS, stamp_s: float | None = None) -> None:
        """`points` in the base frame at `stamp_s`."""
        self._points = points
        self._stamp_s = stamp_s
        self._base: Pose | None = None  # last known pose of the base at that moment
        self._places = NO_POINTS

    def places(self, trail: Trail) -> Points:
        """Return the points in the odometry frame; no points if the pose is unknown."""
        base = None if self._stamp_s is None else trail.pose_at(self._stamp_s)
        if base is None or not len(self._points):
            return NO_POINTS
        if base != self._base:
            self._base, self._places = base, placed(self._points, base)
        return self._places


def check_times(stamp_s: float, arrival_s: float) -> None:
    """Raise Malformed unless both are finite."""
    if not (math.isfinite(stamp_s) and math.isfinite(arrival_s)):
        raise scan.Malformed(say("its stamps are not numbers"))
