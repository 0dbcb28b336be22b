"""The view of obstacles that pages draw."""

import numpy as np

from robots.bridge import state_view
from robots.bridge.gate.values import Obstacles
from tests.bridge.support import CONFIG, OpenGate


def test_view_has_one_remembered_point_per_six_centimetres():
    near = np.array([(1.0, 0.5), (1.01, 0.51), (1.2, -0.5), (20.0, 0.0)])
    gate = OpenGate(CONFIG.gate)
    gate.obstacles = lambda _now_s: Obstacles(
        near, np.array([1, 1, 1, 1]), ("laser", "seen"), ("scan", "memory")
    )
    scan = state_view.scan(gate, (), 100.0)
    assert sorted(zip(scan.remembered_cm[::2], scan.remembered_cm[1::2], strict=True)) == [
        (102, 48),
        (120, -48),
    ]
    assert scan.laser_cm == scan.depth_cm == []
