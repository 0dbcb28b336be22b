"""Sonar memory: echoes as arcs, kept until a sensor that covers the place shows it free (docs/gate.md, 7).

An echo means that an obstacle is somewhere on this arc. A thin leg may leave the cone while it is still in
the way, and then the sonar gets no echo. So a missing echo alone does not prove that a place is free:

* A later reading shows that places in the middle of its cone, well before its range, are free. Places at
  the cone's rim are kept: the cone may be narrower than described, or the obstacle may be too thin there.
* If a sonar stands where it got an echo several times, and gets it no longer, the whole arc is free. Then the
  places that the same obstacle left in memory earlier, while the robot drove there, are free, too.
* Places that a depth picture sees through at all heights that sonars cover are free. A laser sees only one
  plane, below seats and drawers. It counts only if the robot has no depth camera, because the gate then
  relies on the laser for the whole way ahead anyway. Neither removes a place of a present echo: only the
  sonar detects glass.

Echoes get lost. So a reading without an echo counts less than an echo from farther away, and still less if
the sonar recently got a lost echo again. Near standstill the smallest of the last readings is kept, so noise
does not make the robot creep.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.obstacles.depth_camera import Frame, all_seen_through
from robots.bridge.gate.obstacles.point_memory import moved_nearer
from robots.bridge.gate.obstacles.sightings import sight_of_doubtful
from robots.bridge.gate.sensing.depth import Columns
from robots.bridge.gate.sensing.scan import INSIDE_HULL_M, Sweep
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.timing.tremble import Odometer
from robots.bridge.gate.timing.unseen_motion import Doubt
from robots.bridge.gate.values import Kind, SensorHealth
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.planar import NO_POINTS, ORIGIN, Points, from_columns, placed, put, relative_to
from robots.shared.geometry.poses import Pose

Flags = NDArray[np.bool_]

LIVE_S = 0.5  # an echo counts as current for this time
NOISE_M = 0.08  # ranges that differ by less may belong to one obstacle
SURE_SHARE = 0.6  # of the cone about its axis: obstacles there surely give an echo
SAME_PLACE_M = 0.001  # a sensor that moved less stands; 5 mm may take a leg out of its cone
SAME_PLACE_RAD = 0.002
STOOD = 0.01  # metres and radians: a base that may have moved less in a gap of the odometry stood
UNSTEADY_S = 20.0  # for this time after a sonar got a lost echo again, its evidence counts half
SURELY_HEARD = 3  # after this many echoes at one place of the sonar, the obstacle is not at the cone's rim
GONE = 6.0  # a place is forgotten after this much evidence in a row that it is free
FARTHER_COUNTS, NOTHING_COUNTS = 2.0, 1.5  # evidence of an echo from farther away, and of no echo
SAME_THING_S = 1.0  # an echo within this time at a possible place is the same obstacle
SAME_THING_M = 0.5  # places of one obstacle are no farther apart: a person's stride
HEARD_BETWEEN_M = (0.15, 0.6)  # heights: sonars are mounted at knee height and detect little below and above
GRAIN_M = 0.04  # places nearer to each other count as one
REACH_M = 2.0  # from the robot; farther places are out of every sonar's reach
TRAVEL_M = 4.0  # driven distance after which a place is forgotten: the odometry's error is too large
MOST = 300  # places; present echoes and the nearest places are kept

# The rows of the table: place; sonar and its pose at the last echo; time and driven distance of this echo;
# number of the obstacle; evidence in a row that the place is free; echoes in a row from this pose; possible error
# of the place by gaps of the odometry, metres.
X, Y, SONAR, FROM_X, FROM_Y, FROM_YAW, HEARD_S, HEARD_M, THING, PASSES, TIMES, DOUBT_M = range(12)


class Reading(NamedTuple):
    """One range of a sonar.

    `arc`: places from which the echo may come (base frame). `free_m`: nothing is nearer than this.
    """

    sonar: int
    mount: Pose  # base frame
    fov: float
    arc: Points
    free_m: float


class SonarMemory:
    """The arcs of all sonars of a robot, as places in the odometry frame.

    As a source it returns places without a present echo; the sonars return their present echoes.
    """

    kind: Kind = "memory"
    name = "sonar, remembered"
    word = "sonar, remembered"

    def __init__(self, footprint: Footprint) -> None:
        self._footprint = footprint
        self._table: NDArray[np.float64] = np.empty((12, 0))
        self._odometer = Odometer()
        self._here = ORIGIN
        self._now_s = -math.inf
        self._things = 0
        self._unsteady_s: dict[int, float] = {}  # when each sonar last got a lost echo again
        self._resets = 0
        self._changed = True  # whether places changed since they were divided into these two:
        self._heard: dict[int, Points] = {}  # present echoes of each sonar
        self._remembered = NO_POINTS
        self._doubts_m: dict[int | None, NDArray[np.float64]] = {}  # of both; None: of the remembered places

    # --- state ----------------------------------------------------------------------------------

    def heard(self, sonar: int, trail: Trail) -> Points:
        """Return the places of a sonar's present echo, odometry frame."""
        return self._heard.get(sonar, NO_POINTS) if self._is_known(trail) else NO_POINTS

    def places(self, trail: Trail, now_s: float) -> Points:
        return self._remembered if self._is_known(trail) else NO_POINTS

    def moved_nearer(self, points: Points, sonar: int | None = None) -> Points:
        """Return points of a sonar's present echo (None: the remembered ones), each nearer by its possible error."""
        doubts_m = self._doubts_m.get(sonar)
        return points if doubts_m is None else moved_nearer(points, doubts_m, self._footprint)

    def as_seen(self, trail: Trail, now_s: float) -> Points:
        return self.places(trail, now_s)

    def health(self, trail: Trail, now_s: float) -> SensorHealth:
        """Return a good state: memory does not fail, and each sonar has its own state."""
        return SensorHealth(self.name, "sonar", True, None, "")

    def all_places(self) -> Points:
        """Return all places, odometry frame, in the order of `pass_through`."""
        return from_columns(self._table[X], self._table[Y])

    def _lately(self) -> Flags:
        lately: Flags = self._table[HEARD_S] >= self._now_s - LIVE_S
        return lately

    def _is_known(self, trail: Trail) -> bool:
        """Divide the places into present echoes and others; return whether they are valid in this frame."""
        if self._changed:
            self._changed = False
            lately, sonars = self._lately(), self._table[SONAR]
            self._heard = {
                int(sonar): self._table[:2, lately & (sonars == sonar)].T
                for sonar in set(sonars[lately].tolist())
            }
            self._remembered = self._table[:2, ~lately].T
            doubts_m = self._table[DOUBT_M]
            self._doubts_m = {}
            if doubts_m.any():
                self._doubts_m = {sonar: doubts_m[lately & (sonars == sonar)] for sonar in self._heard}
                self._doubts_m[None] = doubts_m[~lately]
        return trail.newest is not None and trail.resets == self._resets

    # --- input ----------------------------------------------------------------------------------

    @property
    def is_empty(self) -> bool:
        """Return whether nothing is remembered."""
        return bool(self._lately().all())

    def hear(
        self, reading: Reading, base: Pose, trail: Trail, now_s: float, *, is_placed: bool = True
    ) -> None:
        """Take a reading that was made when the robot was at `base` (odometry frame).

        Not `is_placed`: the robot may have moved since then, because its odometry is silent. Then the reading shows
        no place free, but its echo counts.
        """
        self._follow(base, trail, now_s)
        sensor = put(reading.mount, base)
        distance, off = self._seen_from(sensor)
        echo = len(reading.arc) > 0
        unsteady = now_s - self._unsteady_s.get(reading.sonar, -math.inf) < UNSTEADY_S
        counts = (FARTHER_COUNTS if echo else NOTHING_COUNTS) / (1.0 + unsteady)
        if is_placed:
            self._clear(reading, distance, off, self._heard_from(reading.sonar, sensor), counts)
        if echo:
            self._add(reading, sensor, placed(reading.arc, base), now_s)
        self._changed = True

    def look(self, frame: Frame, base: Pose, now_s: float) -> None:
        """Take a depth picture that was taken when the robot was at `base`."""
        if self._table.shape[1]:
            places = placed(self.all_places(), relative_to(ORIGIN, base))
            low, high = (np.full(len(places), height_m, dtype=np.float32) for height_m in HEARD_BETWEEN_M)
            columns = Columns(places, low, high)
            self.pass_through(all_seen_through(frame, columns, self._table[DOUBT_M]), now_s)

    def scan(self, sweep: Sweep, laser: Pose, base: Pose, now_s: float) -> None:
        """Take a scan; `laser` is the laser's pose on the robot, which was at `base`."""
        if self._table.shape[1]:
            there = placed(self.all_places(), relative_to(ORIGIN, put(laser, base)))
            self.pass_through(sight_of_doubtful(sweep, there, self._table[DOUBT_M]).through, now_s)

    def pass_through(self, free: Flags, now_s: float) -> None:
        """Take evidence of a sensor that these of `all_places` are free; present echoes are kept."""
        self._table[PASSES, free & (self._table[HEARD_S] < now_s - LIVE_S)] += FARTHER_COUNTS
        self._keep(self._table[PASSES] < GONE)

    def doubt(self, doubt: Doubt, base: Pose) -> None:
        """Take a gap of the odometry: the robot, at `base` now, may be elsewhere, and so may all places.

        Unless the base surely stood, no sonar stands where it stood before the gap.
        """
        table = self._table
        table[DOUBT_M] += doubt.at(np.hypot(table[X] - base.x, table[Y] - base.y))
        if max(doubt) > STOOD:
            table[FROM_X] = math.inf
        self._changed = True

    def forget(self) -> None:
        """Forget places without a present echo."""
        self._keep(self._lately())

    def clear(self) -> None:
        """Forget everything."""
        self._keep(np.zeros(self._table.shape[1], dtype=np.bool_))
        self._odometer.jump()

    # --- within -------------------------------------------------------------------------------

    def _keep(self, kept: Flags) -> None:
        if not kept.all():
            self._table = self._table[:, kept]
            self._changed = True

    def _follow(self, base: Pose, trail: Trail, now_s: float) -> None:
        """Move the robot to `base`: forget places far away, inside the hull, or after too much driving."""
        if trail.resets != self._resets:
            self._resets = trail.resets
            self.clear()
        self._now_s = now_s
        self._here = trail.newest or base  # the stamps of several sonars are not in order
        self._odometer.follow(self._here)
        if not self._table.shape[1]:
            return
        places = placed(self.all_places(), relative_to(ORIGIN, base))
        near = np.hypot(*places.T) < REACH_M
        lasting = self._table[HEARD_M] > self._odometer.driven_m - TRAVEL_M
        outside = (self._footprint.gaps(places) >= -INSIDE_HULL_M) | self._lately()
        self._keep(near & lasting & outside)

    def _seen_from(self, sensor: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the distance of each place from the sensor, and its angle from the sensor's axis."""
        dx, dy = self._table[X] - sensor.x, self._table[Y] - sensor.y
        off = np.abs(np.remainder(np.arctan2(dy, dx) - sensor.yaw + math.pi, math.tau) - math.pi)
        return np.hypot(dx, dy), off

    def _heard_from(self, sonar: int, sensor: Pose) -> Flags:
        """Return which places are echoes that this sonar got at its present place."""
        table = self._table
        turned = np.abs(np.remainder(table[FROM_YAW] - sensor.yaw + math.pi, math.tau) - math.pi)
        moved = np.hypot(table[FROM_X] - sensor.x, table[FROM_Y] - sensor.y)
        same: Flags = (table[SONAR] == sonar) & (moved < SAME_PLACE_M) & (turned < SAME_PLACE_RAD)
        return same

    def _clear(
        self,
        reading: Reading,
        distance: NDArray[np.float64],
        off: NDArray[np.float64],
        same_place: Flags,
        counts: float,
    ) -> None:
        """Forget places that this reading and earlier ones show free."""
        table, half, doubts_m = self._table, reading.fov / 2.0, self._table[DOUBT_M]
        aside = doubts_m / np.maximum(distance, GRAIN_M)
        same_place &= table[TIMES] >= SURELY_HEARD
        in_the_middle = off + aside < SURE_SHARE * half
        free = (distance + doubts_m < reading.free_m - NOISE_M) & (same_place | in_the_middle)
        table[PASSES, free] += counts
        if len(reading.arc):
            heard = (np.abs(distance - reading.free_m) <= NOISE_M + doubts_m) & (off <= half + aside)
            if (table[PASSES, heard & same_place] > 0.0).any():
                self._unsteady_s[reading.sonar] = self._now_s
            table[PASSES, heard] = 0.0
        gone = table[PASSES] >= GONE
        if not gone.any():
            return
        left = gone & free & same_place
        if left.any():
            gone |= self._of_the_same_things(left)
        self._keep(~gone)

    def _of_the_same_things(self, left: Flags) -> Flags:
        """Return the places near these ones that the same obstacles left earlier."""
        table = self._table
        mates = self._belongs_to(left) & (table[HEARD_S] <= table[HEARD_S, left].max())
        near = np.hypot(table[X][:, None] - table[X, left], table[Y][:, None] - table[Y, left]) < SAME_THING_M
        of_them: Flags = mates & near.any(axis=1)
        return of_them

    def _belongs_to(self, places: Flags) -> Flags:
        """Return all echoes of the obstacles at these places."""
        belongs = np.zeros(self._table.shape[1], dtype=np.bool_)
        for thing in set(self._table[THING, places].tolist()):
            belongs |= self._table[THING] == thing
        return belongs

    def _add(self, reading: Reading, sensor: Pose, arc: Points, now_s: float) -> None:
        """Add the arc of an echo."""
        table = self._table
        distance, off = self._seen_from(sensor)
        again = (np.abs(distance - reading.free_m) <= NOISE_M) & (off <= reading.fov / 2.0)
        again &= table[HEARD_S] > now_s - SAME_THING_S
        self._things += 1
        table[THING, self._belongs_to(again)] = self._things
        times = np.where(self._heard_from(reading.sonar, sensor), table[TIMES] + 1.0, 1.0)
        where = sensor.x, sensor.y, sensor.yaw
        news = np.array((reading.sonar, *where, now_s, self._odometer.driven_m, self._things, 0.0, 1.0, 0.0))
        table[SONAR:, again] = news[:, None]
        table[TIMES, again] = times[again]
        rows = again.nonzero()[0]
        x, y = arc.T
        dx, dy = table[X, rows][:, None] - x, table[Y, rows][:, None] - y
        close = dx * dx + dy * dy < GRAIN_M**2
        # Prefer the nearer of two close echoes.
        behind = distance[rows] > reading.free_m
        fresh = ~close[~behind].any(axis=0)
        kept = np.ones(table.shape[1], dtype=np.bool_)
        kept[rows[behind & close[:, fresh].any(axis=1)]] = False
        added = np.vstack((x[fresh], y[fresh], np.repeat(news[:, None], int(fresh.sum()), axis=1)))
        self._table = np.concatenate((table[:, kept], added), axis=1)
        if self._table.shape[1] > MOST:
            here = self._here
            away = np.hypot(self._table[X] - here.x, self._table[Y] - here.y)
            away[self._lately()] = 0.0
            self._table = self._table[:, np.argsort(away, kind="stable")[:MOST]]
