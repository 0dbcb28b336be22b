"""Where movers may be while the robot brakes: discs that move and grow (docs/gate.md, 10).

People slow down, turn and stop. So a mover is forecast with its velocity and with slower ones on the same way, and
each disc grows with the error of the velocity. The roll-out keeps the robot out of the discs. So the robot is only so
fast that it stands before anybody gets there: speed and separation, as in ISO/TS 15066.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.movers.tracks import Track
from robots.shared.geometry.planar import Drift, Points

MOST_MPS = 2.2  # people in buildings
LEAST_MPS = 0.2  # a slower one stands
SHARES = (1.0, 0.6, 0.2)  # of its velocity, with which a mover may go on
ERRORS = 1.2  # sigmas of the velocity
LEAST_ERROR_MPS = 0.45  # people who walk speed up by that within half a second
NEW_ERROR_MPS = 2.0  # error of a new one's velocity: they may run,
NEW_S = 1.0  # until they were followed for a stride
BODY_M = 0.2  # radius of a body above the shins


class Forecast(NamedTuple):
    """Middles of discs, how they move, and the number of each disc's track."""

    points: Points
    drift: Drift
    tracks: NDArray[np.intp]


def may_move(track: Track) -> bool:
    """Return whether a track may move, as far as its errors show."""
    return track.mps + track.error_mps > LEAST_MPS


def forecast(tracks: Sequence[Track], stamp_s: float) -> Forecast:
    """Return the forecast of one or more tracks, from a stamp on, in their frame."""
    rows = [row for number, track in enumerate(tracks) for row in _discs(track, number, stamp_s)]
    table = np.array(rows)
    x, y, vx, vy, radius, grows = table[:, :6].T
    drift = Drift(np.stack((vx, vy), axis=1), radius, grows)
    return Forecast(np.stack((x, y), axis=1), drift, table[:, 6].astype(np.intp))


def _discs(track: Track, number: int, stamp_s: float) -> list[tuple[float, ...]]:
    """Return a row for each part of a mover and each of its possible velocities, at a stamp."""
    age_s = max(stamp_s - track.stamp_s, 0.0)
    grows = _error_mps(track)
    unsure_m = math.sqrt(track.place) + grows * age_s
    capped = min(1.0, MOST_MPS / max(track.mps, MOST_MPS))
    rows: list[tuple[float, ...]] = []
    for share in SHARES:
        vx, vy = share * capped * track.vx, share * capped * track.vy
        for off_x, off_y, radius_m in ((0.0, 0.0, BODY_M), *(part[:3] for part in track.parts)):
            x, y = track.x + off_x + age_s * vx, track.y + off_y + age_s * vy
            rows.append((x, y, vx, vy, radius_m + unsure_m, grows, number))
    return rows


def _error_mps(track: Track) -> float:
    """Return the largest probable error of a velocity: large at first, since one shin may be all that is in view."""
    followed = min((track.seen_s - track.began_s) / NEW_S, 1.0)
    return max(ERRORS * track.error_mps, LEAST_ERROR_MPS, NEW_ERROR_MPS * (1.0 - followed))
