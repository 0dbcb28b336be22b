"""Whether the arm has room for a motion: what the gate's sensors know of the space that it would sweep."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from robots.bridge.gate import words
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.posture import Disc
from robots.bridge.gate.sweep import intruder
from robots.wire import Refusal

WATCH = ("scan", "depth")  # what must be awake before the arm moves
WATCH_ARM = ("scan",)  # and while it does: the arm may carry the camera's view away
SEES_NO_ARM = ("scan", "memory", "sonar")  # at their height it does not reach; depth may show the arm itself


def why_no_room(gate: Gate, space: Sequence[Disc], now_s: float, *, running: bool = False) -> Refusal | None:
    """Why the arm may not sweep this space, or not go on with it: something is there, or nobody can tell."""
    if not space:
        return None
    if running:
        return _unwatched(gate, WATCH_ARM, now_s) or _in_the_way(gate, space, now_s, SEES_NO_ARM)
    return _unwatched(gate, WATCH, now_s) or _in_the_way(gate, space, now_s)


def _unwatched(gate: Gate, kinds: Collection[str], now_s: float) -> Refusal | None:
    """The first sensor of these kinds that does not tell what stands around the arm."""
    for name, kind, ok, _, text in gate.sensor_health(now_s):
        if kind in kinds and not ok:
            why = f"What stands around the arm is not known: {name}: {text}."
            return Refusal("not_watched", why, "gate", {"sensor": name})
    return None


def _in_the_way(
    gate: Gate, space: Sequence[Disc], now_s: float, kinds: Collection[str] = ()
) -> Refusal | None:
    """What sensors of these kinds (none: all) know of in the space that the arm sweeps."""
    obstacles = gate.obstacles(now_s)
    if kinds:
        heard = [number for number, kind in enumerate(obstacles.kinds) if kind in kinds]
        rows = np.isin(obstacles.source, heard)
        obstacles = obstacles._replace(points=obstacles.points[rows], source=obstacles.source[rows])
    found = intruder(space, obstacles, gate.footprint.gaps(obstacles.points), gate.arm_discs)
    if found is None:
        return None
    sensor, side = obstacles.names[found.source], words.side(found.bearing)
    distance = words.figure(max(found.gap_m, 0.0))
    text = f"The arm would sweep where there is something: {sensor}, {distance} m {side}."
    figures: dict[str, float | int | str | None] = {
        "sensor": sensor,
        "distance_m": round(found.gap_m, 2),
        "side": side,
    }
    return Refusal("motion_blocked", text, "gate", figures)
