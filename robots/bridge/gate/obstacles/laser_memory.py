"""Laser memory as a separate source: points that the current scan cannot judge.

`point_memory.py` stores the points and decides how long each point is kept.
"""

from __future__ import annotations

import numpy as np

from robots.bridge.gate.obstacles.point_memory import LASER_LAYER, Memory, moved_nearer, outside_robot
from robots.bridge.gate.obstacles.sightings import sight_of_doubtful
from robots.bridge.gate.obstacles.sources import Carried, Laser
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.bridge.gate.values import Kind, SensorHealth
from robots.shared.geometry.planar import ORIGIN, Points, chosen, placed, relative_to
from robots.shared.geometry.poses import Pose
from robots.shared.sentences import say

# While nobody drives, and the robot stands, memory learns from scans that are so far apart: less than the time that
# counts as watched (`point_memory.GAP_S`).
THINNED_S = 0.15


class LaserMemory:
    """The memory of one laser.

    The memory changes only with a new scan; without new scans, the gate stops the robot anyway. As a
    source it returns only points that the newest scan cannot judge.
    """

    kind: Kind = "memory"

    def __init__(self, laser: Laser) -> None:
        self.name = f"{laser.name}, remembered"
        self.word = say("{sensor}, remembered", sensor=laser.word)
        self._laser = laser
        self._memory = Memory(LASER_LAYER)
        self._carried = self._as_seen = Carried()
        self._resets = 0
        self._learned_s: float | None = None  # stamp of the last scan that it learned from

    def learn(self, trail: Trail, now_s: float) -> None:
        """Learn from the laser's newest scan, once. A scan that does not match the odometry is ignored."""
        sweep, stamp_s = self._laser.sweep, self._laser.freshness.stamp_s
        if stamp_s == self._learned_s:
            return
        self._learned_s = stamp_s
        base = None if stamp_s is None else trail.pose_at(stamp_s)
        if sweep is None or base is None:
            return
        if self._resets != trail.resets:  # after a jump of the odometry remembered places are unknown
            self._resets = trail.resets
            self._memory.clear()
        self._memory.see(placed(self._laser.seen, base), base, now_s)
        origin = relative_to(ORIGIN, base)
        remembered = self._memory.points(now_s)
        there = placed(remembered, relative_to(origin, self._laser.pose))
        sighting = sight_of_doubtful(sweep, there, self._memory.doubts_m())
        kept = np.flatnonzero(~sighting.judged)
        unseen = placed(chosen(remembered, kept), origin)
        points = moved_nearer(unseen, self._memory.errors_m(kept), self._laser.footprint)
        self._carried = Carried(points, stamp_s)
        self._as_seen = Carried(unseen, stamp_s)
        self._memory.pass_through(sighting.through, sighting.past)

    def is_due(self) -> bool:
        """Return whether the newest scan must be learned from, while scans are thinned out."""
        newest_s, learned_s = self._laser.freshness.stamp_s, self._learned_s
        return newest_s is None or learned_s is None or not 0.0 <= newest_s - learned_s < THINNED_S

    @property
    def is_empty(self) -> bool:
        """Return whether nothing is remembered."""
        return self._memory.is_empty

    def doubt(self, doubt: Doubt, base: Pose) -> None:
        """Take a gap of the odometry; the robot is at `base` now."""
        self._memory.doubt(doubt, base)

    def forget(self) -> None:
        """Forget the points of earlier scans."""
        self._memory.clear()
        self._carried = self._as_seen = Carried()

    def places(self, trail: Trail, now_s: float) -> Points:
        return self._carried.places(trail)

    def moved_nearer(self, points: Points) -> Points:
        return points

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        return outside_robot(self._as_seen.places(trail), trail.newest, self._laser.footprint)

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        """Return the laser's state."""
        return self._laser.health(trail, now_s)._replace(name=self.name)
