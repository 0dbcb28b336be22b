"""Correct the heading by comparing two scans of one laser: slipping wheels report turns that did not happen.

The points of the older scan are rotated by each possible turn and compared with the newer scan. A turn is
accepted only if it explains the newer scan well, and far better than the odometry does: the rest of the room
outweighs a walking person, and in a round or empty room nothing is corrected. If two comparisons in a row
find an error in the same direction, the smaller error is also corrected while the laser sees too little to
compare.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.obstacles.sightings import beams_at
from robots.bridge.gate.obstacles.sources import Laser
from robots.bridge.gate.sensing.scan import Sweep
from robots.bridge.gate.timing.trail import Trail
from robots.shared.geometry.planar import placed, relative_to
from robots.shared.geometry.poses import Pose

LEAST_TURN_RAD = 0.26  # least reported turn between two scans that are compared
MOST_TURN_RAD = 1.0  # after a larger turn the scans have too little in common
MOST_MOVED_M = 0.5  # the same for the distance between the scans
ORDINARY_RAD, ORDINARY_SHARE = 0.026, 0.1  # smaller errors of the odometry are ignored
MOST_OFF_SHARE = 0.6  # of the turn; a laser that repeats one scan would be wrong by the whole turn
HELD_FOR = 12  # comparisons without a result, half a turn in all; then the wheels are trusted again
MOST_POINTS = 120
LEAST_POINTS, LEAST_THINGS = 40, 3  # either is enough; one or two small things may be a walking person
APART_M = 0.2  # neighbouring points farther apart belong to two things
COARSE_RAD, FINE_RAD = 0.0175, 0.0035
SAME_M = 0.15  # points farther apart are different things; larger distances count as this
FITS_M = 0.05  # average distance: noise of two scans, and a few moved points
EVEN_M = 0.002  # turns whose fit differs by less count as equally good: the result is their mean
BETTER = 2.0  # the result must fit this many times better than the odometry's turn

Floats = NDArray[np.float64]


class _PastScan(NamedTuple):
    sweep: Sweep
    stamp_s: float
    base: Pose
    resets: int


class Heading:
    """Corrects the trail's yaw by the scans of one laser. It costs processor time only while the robot turns."""

    def __init__(self, laser: Laser) -> None:
        self.laser = laser
        self._then: _PastScan | None = None
        self._share = 1.0  # real turn / reported turn, by the last comparison with a result
        self._silent = 0  # comparisons without a result since then

    def correct(self, trail: Trail) -> None:
        """Use the laser's newest scan. A scan without a pose is ignored."""
        sweep, stamp_s = self.laser.sweep, self.laser.freshness.stamp_s
        base = None if stamp_s is None else trail.pose_at(stamp_s)
        if sweep is None or stamp_s is None or base is None:
            return
        then, self._then = self._then, _PastScan(sweep, stamp_s, base, trail.resets)
        if then is None or then.resets != trail.resets or stamp_s <= then.stamp_s:
            self._share = trail.turn_share = 1.0
            return
        moved = relative_to(base, then.base)
        reported = moved.yaw / trail.turn_share
        is_far = math.hypot(moved.x, moved.y) > MOST_MOVED_M
        if abs(reported) < LEAST_TURN_RAD:
            if is_far:  # the floor may have changed
                self._share = trail.turn_share = 1.0
            else:
                self._then = then
            return
        off = None if is_far or abs(reported) > MOST_TURN_RAD else self._off(then.sweep, sweep, moved)
        if off is not None and (trail.turn_share != 1.0 or abs(off) > _ordinary(reported)):
            trail.turn(then.stamp_s, stamp_s, off)
            self._then = self._then._replace(base=trail.pose_at(stamp_s) or base)
        self._learn(trail, None if off is None else (moved.yaw + off) / reported)

    def _learn(self, trail: Trail, share: float | None) -> None:
        """Learn real turn / reported turn from a comparison; None: it had no result."""
        if share is None:
            self._silent += 1
            if self._silent > HELD_FOR:
                self._share = trail.turn_share = 1.0
            return
        off, before = share - 1.0, self._share - 1.0
        least = min(off, before, key=abs)
        slips = off * before > 0.0 and abs(least) > ORDINARY_SHARE
        trail.turn_share = 1.0 + least if slips else 1.0
        self._share, self._silent = share, 0

    def _off(self, then: Sweep, now: Sweep, moved: Pose) -> float | None:
        """Return how much farther than `moved` the base turned between the scans (rad); None: unclear."""
        points = then.points()
        things = 1 + np.count_nonzero(np.hypot(*np.diff(points, axis=0).T) > APART_M)
        if len(points) < LEAST_POINTS and things < LEAST_THINGS:
            return None
        points = placed(points[:: math.ceil(len(points) / MOST_POINTS)], self.laser.pose)
        ahead = _complex(points) - complex(moved.x, moved.y)
        ends = np.concatenate(([-math.inf], now.ends, [-math.inf]))
        x, y, yaw = self.laser.pose

        def apart_m(turns: Floats) -> Floats:
            """Return the average distance of the scans for each turn; neighbouring beams count, too."""
            rays = (ahead * np.exp(-1j * turns)[:, None] - complex(x, y)) * np.exp(-1j * yaw)
            far, beams = np.abs(rays), beams_at(now, np.angle(rays)) + 1
            apart = np.full(far.shape, SAME_M)
            for near in (beams - 1, beams, np.minimum(beams + 1, len(ends) - 1)):
                np.minimum(apart, np.abs(ends[near] - far), out=apart)
            known = ends[beams] > -math.inf
            seen = known.sum(axis=1)
            means = (apart * known).sum(axis=1) / np.maximum(seen, 1)
            return np.where(seen >= len(points) / 2.0, means, SAME_M)

        most = MOST_OFF_SHARE * abs(moved.yaw)
        coarse = np.arange(-most, most + COARSE_RAD, COARSE_RAD)
        about = coarse[np.argmin(apart_m(moved.yaw + coarse))]
        fine = about + np.arange(-1.5 * COARSE_RAD, 1.5 * COARSE_RAD, FINE_RAD)
        apart = apart_m(moved.yaw + np.append(fine, 0.0))
        least = apart[:-1].min()
        off = float(fine[apart[:-1] < least + EVEN_M].mean())
        if least > FITS_M or abs(off) >= most:
            return None
        return off if apart[-1] > BETTER * least or abs(off) < _ordinary(moved.yaw) else None


def _ordinary(turn: float) -> float:
    return max(ORDINARY_RAD, ORDINARY_SHARE * abs(turn))


def _complex(points: Floats) -> NDArray[np.complex128]:
    """Return the points as complex numbers: a turn is a multiplication."""
    return points[:, 0] + 1j * points[:, 1]
