"""How far the robot turned, by two scans of one laser: wheels that slip tell of turns that were not made.

What the older scan hit is laid out as the newer one should see it, for each turn that may have been made, and compared
with what it sees. Only a turn that explains the newer scan well, and far better than the odometry does, is believed:
where somebody walks by the rest of the room outvotes him, and in a round or an empty room nothing is corrected. A share
of the turn that two looks in a row found holds on while the laser sees too little to tell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.geometry.planar import placed, seen_from
from robots.bridge.gate.obstacles.sightings import beams_at
from robots.bridge.gate.obstacles.sources import Laser
from robots.bridge.gate.sensing.scan import Sweep
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import Pose

LEAST_TURN_RAD = 0.26  # told between two scans that are compared
MOST_TURN_RAD = 1.0  # after more they have too little in common
MOST_WAY_M = 0.5  # and after that
ORDINARY_RAD, ORDINARY_SHARE = 0.026, 0.1  # odometry that is off by less is left alone
MOST_OFF_SHARE = 0.6  # of the turn; a laser that tells the same again and again is off by all of it
HOLDS_LOOKS = 12  # that tell nothing, half a turn in all: then the wheels are trusted again
MOST_POINTS = 120
LEAST_POINTS, LEAST_THINGS = 40, 3  # one of both is enough; one or two small things may be somebody who walks
APART_M = 0.2  # neighbouring points of two things
COARSE_RAD, FINE_RAD = 0.0175, 0.0035
SAME_M = 0.15  # what is farther apart is something else, by however much
FITS_M = 0.05  # on average over all points: the noise of two scans, and a few points that moved
EVEN_M = 0.002  # turns that fit as well as the best but for this: the middle of them is taken
BETTER = 2.0  # times

Floats = NDArray[np.float64]


class _Look(NamedTuple):
    sweep: Sweep
    stamp_s: float
    base: Pose
    resets: int


class Heading:
    """Corrects the trail's yaw by the scans of one laser. It costs something only while the robot turns."""

    def __init__(self, laser: Laser) -> None:
        self.laser = laser
        self._then: _Look | None = None
        self._share = 1.0  # of the told turn that the robot made, by the last look that told something
        self._silent = 0  # looks since

    def correct(self, trail: Trail) -> None:
        """The laser's newest scan has come. One that does not match the odometry tells nothing."""
        sweep, stamp_s = self.laser.sweep, self.laser.freshness.stamp_s
        base = None if stamp_s is None else trail.pose_at(stamp_s)
        if sweep is None or stamp_s is None or base is None:
            return
        then, self._then = self._then, _Look(sweep, stamp_s, base, trail.resets)
        if then is None or then.resets != trail.resets or stamp_s <= then.stamp_s:
            self._share = trail.turn_share = 1.0
            return
        way = seen_from(base, then.base)
        told = way.yaw / trail.turn_share
        is_far = math.hypot(way.x, way.y) > MOST_WAY_M
        if abs(told) < LEAST_TURN_RAD:
            if is_far:  # the floor may be another one
                self._share = trail.turn_share = 1.0
            else:
                self._then = then
            return
        off = None if is_far or abs(told) > MOST_TURN_RAD else self._off(then.sweep, sweep, way)
        if off is not None and (trail.turn_share != 1.0 or abs(off) > _ordinary(told)):
            trail.turn(then.stamp_s, stamp_s, off)
            self._then = self._then._replace(base=trail.pose_at(stamp_s) or base)
        self._learn(trail, None if off is None else (way.yaw + off) / told)

    def _learn(self, trail: Trail, share: float | None) -> None:
        """The robot made this share of the turn that was told; None: the look told nothing."""
        if share is None:
            self._silent += 1
            if self._silent > HOLDS_LOOKS:
                self._share = trail.turn_share = 1.0
            return
        off, before = share - 1.0, self._share - 1.0
        least = min(off, before, key=abs)
        slips = off * before > 0.0 and abs(least) > ORDINARY_SHARE
        trail.turn_share = 1.0 + least if slips else 1.0
        self._share, self._silent = share, 0

    def _off(self, then: Sweep, now: Sweep, way: Pose) -> float | None:
        """How much farther than `way` the base turned between the scans, radians; None if they do not tell."""
        points = then.points()
        things = 1 + np.count_nonzero(np.hypot(*np.diff(points, axis=0).T) > APART_M)
        if len(points) < LEAST_POINTS and things < LEAST_THINGS:
            return None
        points = placed(points[:: math.ceil(len(points) / MOST_POINTS)], self.laser.pose)
        ahead = _complex(points) - complex(way.x, way.y)
        ends = np.concatenate(([-math.inf], now.ends, [-math.inf]))
        x, y, yaw = self.laser.pose

        def apart_m(turns: Floats) -> Floats:
            """How far the scans are apart on average, for each turn of the base. A beam to either side is no matter."""
            rays = (ahead * np.exp(-1j * turns)[:, None] - complex(x, y)) * np.exp(-1j * yaw)
            far, beams = np.abs(rays), beams_at(now, np.angle(rays)) + 1
            apart = np.full(far.shape, SAME_M)
            for beside in (beams - 1, beams, np.minimum(beams + 1, len(ends) - 1)):
                np.minimum(apart, np.abs(ends[beside] - far), out=apart)
            known = ends[beams] > -math.inf
            seen = known.sum(axis=1)
            means = (apart * known).sum(axis=1) / np.maximum(seen, 1)
            return np.where(seen >= len(points) / 2.0, means, SAME_M)

        most = MOST_OFF_SHARE * abs(way.yaw)
        coarse = np.arange(-most, most + COARSE_RAD, COARSE_RAD)
        about = coarse[np.argmin(apart_m(way.yaw + coarse))]
        fine = about + np.arange(-1.5 * COARSE_RAD, 1.5 * COARSE_RAD, FINE_RAD)
        apart = apart_m(way.yaw + np.append(fine, 0.0))
        least = apart[:-1].min()
        off = float(fine[apart[:-1] < least + EVEN_M].mean())
        if least > FITS_M or abs(off) >= most:
            return None
        return off if apart[-1] > BETTER * least or abs(off) < _ordinary(way.yaw) else None


def _ordinary(turn: float) -> float:
    return max(ORDINARY_RAD, ORDINARY_SHARE * abs(turn))


def _complex(points: Floats) -> NDArray[np.complex128]:
    """The points as complex numbers, which a turn multiplies."""
    return points[:, 0] + 1j * points[:, 1]
