"""Drives to a place by the robot's own navigation: what begins one, and what ends it."""

from __future__ import annotations

import math

from tests.processes import until
from tests.ros.navigation.conftest import place


def test_it_drives_to_a_place(traveller, truth):
    seq = traveller.go(3.4, 1.8, 1.0)
    state = traveller.drives()
    assert state.going.left_m > 0.1 and state.going.who == "Ann"
    end = traveller.ended(seq)
    assert (end.outcome, end.text) == ("arrived", "")
    x, y, heading = place(truth)
    assert math.dist((x, y), (3.4, 1.8)) < 0.25
    assert abs(math.remainder(heading - 1.0, math.tau)) < 0.3
    until(lambda: "go.end arrived" in traveller.process.recorded(), "the end on record")
