"""Watch a robot that drives itself: by its measured velocity, with the gate's obstacles and roll-out.

The robot drives on while it can still brake clear of all obstacles that sensors have measured. Two predicted
motions must be free of obstacles until the robot stands: (1) it keeps its measured velocity; (2) it follows
navigation's commanded velocity. The second is needed because the measured velocity of a standing robot shows
too late in which direction it will drive. The watch assumes that zeros take effect after the latency that was
measured with people's commands, at least after the profile's latency plus its spare, and later while the
robot's messages come late.

Obstacles count at their measured places. For a person's command the gate assumes the worst case: it adds near
sides that the camera could not measure, and the position error of remembered obstacles. A person can look,
turn, and press Forget. Navigation, which turns beside tables, would lose its goal because of obstacles that
no sensor has seen.

Where no sensor looks, navigation may drive faster than the gate allows a person, but only for a moment: while
a head turns or a recovery backs up. The gate remembers the camera's earlier pictures, as far as they showed
the way.

One kind of point is ignored: a remembered sonar echo that is no longer present, at a place ahead that the
laser or a fresh depth picture covers. A sonar measures only the distance of an echo; its place may be
anywhere on an arc.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate import words
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.motion.safe_twist import is_finite, is_still
from robots.bridge.gate.obstacles.sonar_memory import SonarMemory
from robots.bridge.gate.sensing.depth import CELL_M
from robots.bridge.gate.timing.freshness import DEPTH_STALE_S
from robots.bridge.gate.values import Obstacles
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import say

DEPTH_LOST_S = 2.0
UNSEEN_S = 2.0  # longest time for which the way ahead may be outside the depth picture
BLIND_S = 0.5  # longest time for which the robot may be too fast in a direction that no laser watches
ECHOES = SonarMemory.name
# Bearings within this angle count as ahead; echoes of rear sonars never lie there.
AHEAD_RAD = math.radians(75.0)


class Watch:
    """The watch over one drive: `judge`, with the time since a sensor last watched the robot's way."""

    def __init__(self) -> None:
        # When the depth camera last showed the robot's way, and when the robot was last slow enough for a
        # direction without a laser. None: before the first judgement, which sets both.
        self._seen_s: float | None = None
        self._watched_s: float | None = None

    def judge(self, gate: Gate, commanded: Velocity | None, now_s: float) -> Verdict:
        """Return the verdict on how the robot moves: "free", else the rule by which it must brake now."""
        verdict, limit = judge(gate, commanded, now_s), gate.unwatched(now_s)
        if self._seen_s is None or gate.looks_ahead(now_s):
            self._seen_s = now_s
        if self._watched_s is None or limit is None or limit.way is None:
            self._watched_s = now_s
        since_s, patience_s = (
            (self._seen_s, UNSEEN_S) if limit and not limit.way else (self._watched_s, BLIND_S)
        )
        if limit is None or verdict.code != "free" or now_s - since_s <= patience_s:
            return verdict
        moving = gate.velocity
        _, in_words = words.way(math.atan2(moving.vy, moving.vx))
        text = say(
            "stopped: the robot drove {speed:fine} m/s {way}, but {why}",
            speed=math.hypot(moving.vx, moving.vy),
            way=in_words,
            why=words.reason(limit.text),
        )
        return Verdict(STILL, moving, limit.code, text, way=limit.way)


def judge(gate: Gate, commanded: Velocity | None, now_s: float) -> Verdict:
    """Return the verdict on how the robot moves: "free", else the rule by which it must brake now.

    `commanded`: the twist that navigation sends to the base; None: it sends none.
    """
    moving = gate.velocity
    if fault := gate.fault(now_s):
        return Verdict(STILL, moving, fault.code, say("stopped: {why}", why=fault.text), fault.sensor)
    expected = [moving] if commanded is None or not is_finite(commanded) else [moving, commanded]
    free = Verdict(moving, moving, "free", "")
    if all(map(is_still, expected)):
        return free
    parameters = gate.profile.parameters
    if (lost := depth_lost(gate, now_s)) is not None and math.hypot(
        moving.vx, moving.vy
    ) > gate.profile.blind_mps:
        return Verdict(STILL, moving, "depth_stale", say("stopped: {why}", why=lost))
    usual_s = parameters.latency_s + parameters.latency_spare_s
    measured_s = gate.latency.measured_s or 0.0
    latency_s = max(usual_s, measured_s) + gate.latency.lateness_s(now_s)
    obstacles = _without_old_echoes(gate, gate.obstacles_as_seen(now_s), now_s)
    return gate.must_brake(expected, obstacles, latency_s) or free


def depth_lost(gate: Gate, now_s: float) -> str | None:
    """Return in words that the depth camera is lost: silent for longer than while the head turns.

    None: it is not lost, or the robot's profile uses no depth camera.
    """
    if gate.profile.depth is None:
        return None
    age_s = gate.depth_age_s(now_s)
    if age_s is None:
        return say("no picture of the depth camera has come")
    return say("the depth camera’s picture is {age:age} old", age=age_s) if age_s > DEPTH_LOST_S else None


def spare_m(gate: Gate, now_s: float) -> float:
    """Return the gap (m) to the nearest obstacle that is seen or remembered, unseen near sides included.

    Sonars do not count: they do not show the place of an obstacle. Navigation may start towards an obstacle
    at any moment, and zeros take effect some centimetres later.
    """
    obstacles = gate.obstacles_as_seen(now_s)
    kinds = zip(obstacles.kinds, obstacles.names, strict=True)
    placed = np.array([kind != "sonar" and name != ECHOES for kind, name in kinds])
    seen = obstacles.points[placed[obstacles.source]] if len(obstacles.points) else obstacles.points
    # Near sides are known in steps of a cell: an obstacle may begin one cell nearer than its nearest place.
    sides = ((seen, 0.0), (gate.unseen_near_sides(), CELL_M))
    gaps_m = [float(gate.footprint.gaps(points).min()) - less_m for points, less_m in sides if len(points)]
    return min(gaps_m, default=math.inf)


def _without_old_echoes(gate: Gate, obstacles: Obstacles, now_s: float) -> Obstacles:
    echoes = obstacles.source == obstacles.names.index(ECHOES)
    if not echoes.any():
        return obstacles
    kept = ~(echoes & _covered(gate, obstacles, now_s))
    return obstacles._replace(points=obstacles.points.T[:, kept].T, source=obstacles.source[kept])


def _covered(gate: Gate, obstacles: Obstacles, now_s: float) -> NDArray[np.bool_]:
    """Return which points lie ahead; none without a laser that looks ahead or a fresh depth picture."""
    bearings = np.arctan2(obstacles.points[:, 1], obstacles.points[:, 0])
    ahead: NDArray[np.bool_] = np.abs(bearings) < AHEAD_RAD
    age_s = gate.depth_age_s(now_s)
    seen = gate.laser_looks(0.0) or (age_s is not None and age_s <= DEPTH_STALE_S)
    return ahead if seen else np.zeros_like(ahead)
