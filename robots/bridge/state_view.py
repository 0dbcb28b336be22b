"""Parts of the reports about the robot: what the gate knows, and a view of the surroundings. Change nothing."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate import words
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import Forgotten, Kind, Obstacles
from robots.shared import wire
from robots.shared.configuration.bridge_config import SonarSource
from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import SpeedLimit, Verdict

VIEW_RADIUS_M = 8.0
DRAWN_GRAIN_CM = 6  # one point is drawn for each cell of this size: a view for fifty viewers must be small


def gate_state(gate: Gate, now_s: float) -> dict[str, Any]:
    """Return the fields of `wire.State` that the gate knows."""
    return {
        "sensors": [wire.Sensor(*health) for health in gate.sensor_health(now_s)],
        "latency_s": round(gate.latency.in_force_s(now_s), 2),
        "latency_measured": gate.latency.measured_s is not None,
        "arm": [(round(x, 2), round(y, 2), round(r, 2)) for x, y, r in gate.arm_discs],
    }


def scan(gate: Gate, sonars: Sequence[SonarSource], now_s: float, with_heights: bool = False) -> wire.Scan:
    """Return obstacles and sonar ranges for views."""
    obstacles = gate.obstacles(now_s)
    x, y = obstacles.points.T
    near = np.flatnonzero(x * x + y * y < VIEW_RADIUS_M**2)
    depth_cm = _centimetres(obstacles, near, {"depth"}, DRAWN_GRAIN_CM)
    return wire.Scan(
        laser_cm=_centimetres(obstacles, near, {"scan"}),
        sonar_cm=[_range_cm(gate, sonar, now_s) for sonar in sonars],
        depth_cm=depth_cm,
        remembered_cm=_centimetres(obstacles, near, {"memory", "depth memory"}, DRAWN_GRAIN_CM),
        unseen=[(round(start, 2), round(end, 2)) for start, end in gate.unseen(now_s)],
        heights_cm=_heights_cm(gate, depth_cm) if with_heights else [],
    )


def _heights_cm(gate: Gate, depth_cm: list[int]) -> list[int]:
    """Return the lowest and highest height at each of these points (cm, flat); an empty list if unknown."""
    found = gate.depth_heights(np.array(depth_cm, dtype=np.float64).reshape(-1, 2) / 100.0)
    if found is None:
        return []
    heights = np.stack(found, axis=1)
    heights = np.where(np.isfinite(heights), heights, 0.0)  # the gate has forgotten these cells
    flat: list[int] = np.rint(heights * 100.0).astype(np.int32).ravel().tolist()
    return flat


def _centimetres(
    obstacles: Obstacles, near: NDArray[np.intp], kinds: Collection[Kind], grain: int = 1
) -> list[int]:
    """Return the points `near` of these kinds of sensors, in centimetres: flat (x, y, x, y ...), one per grid cell.

    `near` holds row numbers; a cell has `grain` centimetres.
    """
    drawn = np.array([kind in kinds for kind in obstacles.kinds], dtype=np.bool_)
    rows = near[drawn[obstacles.source[near]]]
    if not len(rows):
        return []
    places = np.rint(obstacles.points.T.take(rows, axis=1) * (100 / grain)).astype(np.int32)
    if grain > 1:
        cells = places[0] * 10_000 + places[1]
        order = cells.argsort(kind="stable")  # half the time of np.unique
        ordered = cells[order]
        first = np.append(True, ordered[1:] != ordered[:-1])
        places = places.take(order[first], axis=1) * grain
    flat: list[int] = places.T.ravel().tolist()
    return flat


def _range_cm(gate: Gate, sonar: SonarSource, now_s: float) -> int | None:
    range_m = gate.sonar_range(sonar.frame_id, now_s)
    return None if range_m is None else round(range_m * 100)


def forgotten(event: Forgotten, noticed_s: float | None, now_s: float) -> wire.Forgotten | None:
    """Return the last time at which memory was dropped. `noticed_s` None: not noticed yet."""
    if noticed_s is None:
        return None
    return wire.Forgotten(event.number, event.code, words.forgotten(event.code), round(now_s - noticed_s, 1))


def verdict(verdict: Verdict, limits: Sequence[SpeedLimit]) -> wire.Verdict:
    """Return a verdict for people, with the speed limits that are shown next to it."""

    def rounded(velocity: Velocity) -> tuple[float, float, float]:
        return (round(velocity.vx, 3), round(velocity.vy, 3), round(velocity.w, 3))

    return wire.Verdict(
        code=verdict.code,
        text=verdict.text,
        asked=rounded(verdict.asked),
        allowed=rounded(verdict.velocity),
        sensor=verdict.sensor,
        distance_m=_rounded(verdict.distance_m),
        bearing_rad=_rounded(verdict.bearing_rad),
        side=verdict.side,
        point=(round(verdict.point[0], 2), round(verdict.point[1], 2)) if verdict.point else None,
        limits=[wire.SpeedLimit(code, text, round(mps, 3), way) for code, text, mps, way in limits],
        way=verdict.way,
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)
