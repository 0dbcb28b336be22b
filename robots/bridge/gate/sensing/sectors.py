"""Sectors around the base with and without a sensor."""

from __future__ import annotations

import math
from collections.abc import Iterable

from robots.bridge.gate.values import Sector
from robots.shared.geometry.planar import wrapped
from robots.shared.geometry.poses import Pose

AT_M = 1.0  # sectors are computed for this distance
LEAST_RAD = math.radians(3.0)  # narrower gaps are ignored


def sector_of(mount: Pose, first: float, span: float) -> Sector:
    """Return the sector about the base that a sensor covers: `span` radians from `first`, sensor's frame."""
    if span >= math.tau:
        return 0.0, math.tau
    edges = [mount.yaw + first, mount.yaw + first + span]
    start, end = (
        math.atan2(mount.y + AT_M * math.sin(edge), mount.x + AT_M * math.cos(edge)) for edge in edges
    )
    return start, start + (end - start) % math.tau


def gaps_between(covered: Iterable[Sector]) -> list[Sector]:
    """Return the sectors that none of these covers; each begins in -pi..pi and goes counter-clockwise."""
    pieces: list[Sector] = []
    for start, end in covered:
        first = wrapped(start)
        for turn in (-math.tau, 0.0):
            pieces.append((max(first + turn, -math.pi), min(first + turn + end - start, math.pi)))
    gaps, reached = [], -math.pi
    for start, end in sorted(piece for piece in pieces if piece[0] < piece[1]):
        if start > reached:
            gaps.append((reached, start))
        reached = max(reached, end)
    if reached < math.pi:
        gaps.append((reached, math.pi))
    if len(gaps) > 1 and gaps[0][0] == -math.pi and gaps[-1][1] == math.pi:
        gaps = [*gaps[1:-1], (gaps[-1][0], gaps[0][1] + math.tau)]
    return [(start, end) for start, end in gaps if end - start >= LEAST_RAD]
