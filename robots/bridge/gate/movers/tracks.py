"""Follow movers: arrivals near each other are one person, who walks with constant velocity (docs/gate.md, 10).

A Kalman filter with the state place and velocity. Both axes have the same errors, so one set of variances serves
for both. The measured place of a person is the middle of their shins: a shin that stands and one that swings
keep it about the hips.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from robots.bridge.gate.movers.arrivals import Arrival, Look

PAIR_M = 0.8  # arrivals within this belong to one person
ASIDE_M = 0.75  # a shin's distance from the forecast hips: half of a long step, and the forecast's error
MEASURED_M, ALONE_M = 0.12, 0.22  # error of the middle of several arrivals, and of one alone
ACCELERATES_MPS2 = 1.5  # people start, stop and turn
STARTS_M, STARTS_MPS = 0.15, 1.4  # errors of place and velocity at first sight
LEAST_BEAMS = 3  # that begin a track
LEAST_M = 0.022  # radius of what begins a track: a chair's leg that flickers is thinner than a shin
KEPT_S = 1.0  # unseen, while no scan shows the place
LOST_S = 0.3  # the same, while scans show it
STANDS_S = 3.0  # a mover that stands goes on after less
STANDS_M = 0.08  # from the outline of an arrival to the points of the same thing
SAME_M = 0.35  # two tracks this near are one


@dataclass
class Track:
    """A mover: place (m) and velocity (m/s) in the odometry frame at a stamp, and the variances of their errors."""

    stamp_s: float
    x: float
    y: float
    parts: list[Arrival]  # its last arrivals; their places are offsets
    vx: float = 0.0
    vy: float = 0.0
    place: float = STARTS_M**2
    both: float = 0.0
    speed: float = STARTS_MPS**2
    began_s: float = field(init=False)  # stamp of its first arrivals,
    moved_s: float = field(init=False)  # of its last arrivals,
    seen_s: float = field(init=False)  # and when it was last seen, moving or standing

    def __post_init__(self) -> None:
        self.began_s = self.moved_s = self.seen_s = self.stamp_s

    @property
    def mps(self) -> float:
        """Its speed."""
        return math.hypot(self.vx, self.vy)

    @property
    def error_mps(self) -> float:
        """The error (one sigma) of its velocity, along each axis."""
        return math.sqrt(self.speed)

    def move_on(self, stamp_s: float) -> None:
        """Forecast the state at a later stamp."""
        dt = stamp_s - self.stamp_s
        noise = ACCELERATES_MPS2**2
        self.x += dt * self.vx
        self.y += dt * self.vy
        self.place += 2.0 * dt * self.both + dt * dt * self.speed + noise * dt**4 / 4.0
        self.both += dt * self.speed + noise * dt**3 / 2.0
        self.speed += noise * dt * dt
        self.stamp_s = stamp_s

    @property
    def places(self) -> list[Arrival]:
        """Where its arrivals were last seen."""
        since_s = self.stamp_s - self.seen_s
        x, y = self.x - since_s * self.vx, self.y - since_s * self.vy
        return [part._replace(x=x + part.x, y=y + part.y) for part in self.parts]

    def correct(self, arrivals: list[Arrival]) -> None:
        """Take the arrivals that belong to it, at its stamp."""
        x, y = _middle(arrivals)
        error = (MEASURED_M if len(arrivals) > 1 else ALONE_M) ** 2
        gain, speed_gain = self.place / (self.place + error), self.both / (self.place + error)
        off_x, off_y = x - self.x, y - self.y
        self.x += gain * off_x
        self.y += gain * off_y
        self.vx += speed_gain * off_x
        self.vy += speed_gain * off_y
        self.speed -= speed_gain * self.both
        self.both *= 1.0 - gain
        self.place *= 1.0 - gain
        self.parts = _about(self.x, self.y, arrivals)
        self.seen_s = self.stamp_s

    def distance_m(self, x: float, y: float) -> float:
        """Return how far a place is from it."""
        return math.hypot(x - self.x, y - self.y)


def followed(tracks: list[Track], arrivals: list[Arrival], look: Look) -> list[Track]:
    """Return the tracks after a scan, the longest known first: corrected by its arrivals, with new ones."""
    for track in tracks:
        track.move_on(look.stamp_s)
    own: list[list[Arrival]] = [[] for _ in tracks]
    left = []
    for one in arrivals:
        near = [track.distance_m(one.x, one.y) for track in tracks]
        if near and min(near) < ASIDE_M:
            own[near.index(min(near))].append(one)
        else:
            left.append(one)
    for track, some in zip(tracks, own, strict=True):
        if some:
            track.correct(some)
            track.moved_s = look.stamp_s
        elif standing := _standing(track, look):
            track.correct(standing)
    tracks = _without_doubles(tracks)
    while left:
        first = left[0]
        pair = [one for one in left if math.hypot(one.x - first.x, one.y - first.y) < PAIR_M]
        left = [one for one in left if one not in pair]
        x, y = _middle(pair)
        beams = sum(one.beams for one in pair)
        if beams >= LEAST_BEAMS and max(one.radius_m for one in pair) >= LEAST_M:
            tracks.append(Track(look.stamp_s, x, y, _about(x, y, pair)))
    return tracks


def _standing(track: Track, look: Look) -> list[Arrival]:
    """Return what still stands where a mover was last seen: somebody who stops is no arrival any more."""
    if look.stamp_s - track.moved_s > STANDS_S:
        return []
    return [place for place in track.places if look.has_hit(place.x, place.y, place.radius_m + STANDS_M)]


def _without_doubles(tracks: list[Track]) -> list[Track]:
    kept: list[Track] = []
    for track in tracks:
        if all(other.distance_m(track.x, track.y) > SAME_M for other in kept):
            kept.append(track)
    return kept


def _about(x: float, y: float, arrivals: list[Arrival]) -> list[Arrival]:
    """Return arrivals with places relative to (x, y)."""
    return [one._replace(x=one.x - x, y=one.y - y) for one in arrivals]


def _middle(arrivals: list[Arrival]) -> tuple[float, float]:
    """Return the middle of the arrivals, each with the same weight: a shin half hidden counts as much."""
    return sum(one.x for one in arrivals) / len(arrivals), sum(one.y for one in arrivals) / len(arrivals)
