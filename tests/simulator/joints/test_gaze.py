"""The head turns its camera towards the target, within the limits of its neck."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.simulator.joints.frames import OPTICAL_FRAME, FrameError, frames, place
from robots.simulator.joints.gaze import PAN, TILT, GazeError, aim, error, eye
from robots.simulator.joints.joint_table import HOME
from robots.simulator.sensors.body import TIAGO

TABLE = frames(TIAGO)
FORWARD = (1.0, 0.0, 0.0)
OPTICAL_AXIS = (0.0, 0.0, 1.0)


def looking(frame, axis, target) -> tuple[dict[str, float], float]:
    """Pan, tilt, and the remaining error of the camera's direction, rad."""
    looks = eye(TABLE, frame, axis)
    turned = aim(TABLE, looks, np.array(target), HOME)
    return turned, error(TABLE, looks, np.array(target), HOME | turned)


@pytest.mark.parametrize("target", [(1.0, 0.0, 0.0), (2.0, 1.5, 0.7), (0.8, -1.2, 1.6), (0.4, 0.9, 1.4)])
@pytest.mark.parametrize(
    ("frame", "axis"),
    [("head_2_link", FORWARD), (OPTICAL_FRAME, OPTICAL_AXIS), ("xtion_rgb_frame", FORWARD), ("", (0, 0, 0))],
)
def test_the_axis_meets_the_target(frame, axis, target):
    assert looking(frame, axis, target)[1] < 1e-4


def test_an_axis_that_squints_meets_the_target_too():
    assert looking("head_2_link", (1.0, 0.3, 0.2), (2.0, 0.5, 0.8))[1] < 1e-4


def test_the_head_looks_down_at_low_targets():
    turned, _ = looking(OPTICAL_FRAME, OPTICAL_AXIS, (1.0, 0.0, 0.0))
    assert turned[PAN] == pytest.approx(0.0, abs=1e-6)
    assert turned[TILT] < -0.5


def test_the_neck_ends_at_its_limits():
    turned, off = looking(OPTICAL_FRAME, OPTICAL_AXIS, (-2.0, 1.0, 1.2))
    assert turned[PAN] == pytest.approx(math.radians(75.0))
    assert off > 1.0


@pytest.mark.parametrize(
    ("frame", "axis", "target"),
    [
        ("base_link", FORWARD, (1.0, 0.0, 0.0)),
        ("nowhere", FORWARD, (1.0, 0.0, 0.0)),
        ("head_2_link", (math.nan, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ("head_2_link", FORWARD, (math.inf, 0.0, 0.0)),
    ],
)
def test_what_cannot_be_looked_at_is_refused(frame, axis, target):
    with pytest.raises((FrameError, GazeError)):
        looking(frame, axis, target)


def test_an_unknown_frame_has_no_place():
    with pytest.raises(FrameError, match="no frame 'nowhere'"):
        place(TABLE, "nowhere", HOME)
