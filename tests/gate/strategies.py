"""Hypothesis strategies of the gate's tests: clouds of points and twists."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from robots.shared.geometry.poses import Velocity


def clouds(reach_m):
    """Up to 12 points (N, 2) in a square around the robot."""
    coordinates = st.floats(-reach_m, reach_m)
    return st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=12).map(np.array)


def twists(decimals):
    """Forward and turning speeds up to 1 m/s and 2 rad/s, rounded."""
    return st.builds(
        Velocity,
        st.floats(-1.0, 1.0).map(lambda v: round(v, decimals)),
        st.just(0.0),
        st.floats(-2.0, 2.0).map(lambda w: round(w, decimals)),
    )
