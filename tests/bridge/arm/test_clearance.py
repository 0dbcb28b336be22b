"""Arm clearance: while the arm moves, depth points that cannot be the arm count as intruders."""

from types import SimpleNamespace

import numpy as np
import pytest

from robots.bridge.arm.clearance import BESIDE_ARM_M, LATELY_S, ArmClearance
from robots.bridge.gate.values import Obstacles
from robots.shared.geometry.footprint import Disc

SPACE = ((0.8, 0.0, 0.5),)
HAND = (0.6, 0.0, 0.09)
KINDS = ("scan", "memory", "sonar", "depth", "depth memory")


class Scene:
    """One arm and its surroundings: its position and the obstacles of each kind of sensor."""

    def __init__(self):
        self.now_s = 100.0
        self.lies = (HAND,)
        self.problem = ""
        self.seen = {}
        gate = SimpleNamespace(
            obstacles=self.obstacles,
            sensor_health=lambda _now_s: [],
            footprint=Disc(0.27),
            arm_discs=(),
        )
        self.room = ArmClearance(
            gate, lambda: SimpleNamespace(arm=lambda: self.lies, arm_problem=lambda: self.problem)
        )

    def obstacles(self, _now_s):
        points = [point for kind in KINDS for point in self.seen.get(kind, [])]
        source = np.repeat(range(len(KINDS)), [len(self.seen.get(kind, [])) for kind in KINDS])
        return Obstacles(np.array(points, float).reshape(-1, 2), source, KINDS, KINDS)

    def why_not(self, running=True):
        """The sensor that sees an obstacle in the arm's way, None if there is none."""
        refusal = self.room.refuse(SPACE, self.now_s, running=running)
        return refusal and refusal.figures["sensor"]

    def moves(self, lies, seconds):
        """Let the arm lie at these discs for some seconds."""
        self.lies = lies
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-9:
            self.now_s += 0.05
            self.why_not()


@pytest.fixture
def scene():
    return Scene()


def beside(disc, gap_m):
    """A place at this distance outside a disc."""
    x, y, radius = disc
    return x, y + radius + gap_m


@pytest.mark.parametrize("kind", ["scan", "memory", "sonar", "depth"])
def test_each_kind_of_sensor_sees_an_intruder(scene, kind):
    scene.seen = {kind: [beside(HAND, 0.2)]}
    assert scene.why_not() == kind


def test_depth_points_at_the_arm_are_not_intruders(scene):
    scene.seen = {"depth": [beside(HAND, -0.05), beside(HAND, BESIDE_ARM_M - 0.01)]}
    assert scene.why_not() is None
    scene.seen["depth"].append(beside(HAND, BESIDE_ARM_M + 0.01))
    assert scene.why_not() == "depth"


def test_frame_may_show_the_arm_where_it_was_just_before(scene):
    scene.why_not()
    scene.moves(((0.9, 0.3, 0.09),), LATELY_S - 0.1)
    scene.seen = {"depth": [HAND[:2]]}
    assert scene.why_not() is None
    scene.moves(scene.lies, 0.2)
    assert scene.why_not() == "depth"


def test_without_arm_position_only_the_depth_camera_is_ignored(scene):
    scene.seen = {"depth": [beside(HAND, 0.2)]}
    scene.lies = None
    assert scene.why_not() is None
    scene.moves((HAND,), LATELY_S - 0.1)
    assert scene.why_not() is None  # a picture may be older than the motion
    scene.moves((HAND,), 0.2)
    assert scene.why_not() == "depth"
    scene.lies = None
    scene.now_s += 0.05
    assert scene.why_not() is None
    scene.seen["memory"] = [beside(HAND, 0.2)]
    assert scene.why_not() == "memory"


def test_an_arm_within_the_base_hides_nothing(scene):
    scene.lies = ()
    scene.seen = {"depth": [HAND[:2]]}
    assert scene.why_not() == "depth"


def test_remembered_depth_prevents_a_start_but_cancels_nothing(scene):
    scene.seen = {"depth memory": [beside(HAND, 0.2)]}
    assert scene.why_not(running=False) == "depth memory"
    assert scene.why_not() is None


def test_motion_starts_from_the_arms_present_place(scene):
    scene.lies = None
    scene.why_not()
    assert scene.why_not(running=False) is None
    scene.lies, scene.seen = (HAND,), {"depth": [beside(HAND, 0.2)]}
    assert scene.why_not() == "depth"


def test_a_motion_is_cancelled_when_joint_states_end(scene):
    assert scene.why_not(running=False) is None
    scene.problem = "its joint states are 0.6 s old"
    scene.moves(None, LATELY_S)
    assert scene.why_not() is None
    scene.moves(None, 0.1)
    assert scene.why_not() == "arm"


def test_no_motion_begins_while_joint_states_are_missing(scene):
    scene.problem = "its joint states are 0.6 s old"
    assert scene.why_not(running=False) == "arm"
    assert scene.room.refuse((), scene.now_s) is None  # the motion does not move the arm
    scene.problem = ""
    assert scene.why_not(running=False) is None
