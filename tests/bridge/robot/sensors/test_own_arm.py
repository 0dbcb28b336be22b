"""The robot's arm in its depth camera's picture, also if the robot's description lacks the hand."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from robots.bridge.arm.clearance import ArmClearance
from robots.bridge.arm.posture import ArmPosture
from robots.bridge.arm.tree import Tree
from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.robot.sensors import joints
from robots.bridge.robot.sensors.joints import JointReception
from robots.simulator.joints.joint_table import HOME
from tests.gate.depth_pictures import FLOOR, LOOK_AHEAD, Looker, camera
from tests.ros.tiago_arm import ARM, DESCRIPTION, JOINTS, without_hand

FOLDED = [HOME[joint] for joint in JOINTS]
RAISED = [0.9, -0.4, -0.3, 1.7, -1.5, 0.9, 0.0]
AHEAD = [1.5, 0.2, -0.4, 1.2, -1.2, 0.3, 0.0]
HALF_M = 0.045  # half of the arm's thickness


class Robot:
    """A TIAGo in an empty hall, whose camera sees its arm."""

    def __init__(self, monkeypatch, description):
        self.looker = Looker([FLOOR], has_arm=True)
        self.looker.to_base = camera(LOOK_AHEAD)
        monkeypatch.setattr(joints.time, "monotonic", lambda: self.looker.now_s)
        self.posture = ArmPosture(ARM)
        self.posture.describe(description)
        self.posture.awaits_description = False  # as the node notes when the master has answered
        self.reception = JointReception(self.posture, self.looker.gate.observe_posture)
        arm = SimpleNamespace(
            arm=lambda: self.posture.arm(self.looker.now_s),
            arm_problem=lambda: self.posture.problem(self.looker.now_s),
        )
        self.room = ArmClearance(self.looker.gate, lambda: arm)
        self.at = FOLDED

    def stay(self, seconds):
        for _ in range(round(seconds / 0.1)):
            self._step(self.at)

    def move(self, there, seconds=0.8):
        for at in np.linspace(self.at, there, round(seconds / 0.1) + 1)[1:]:
            self._step(at.tolist())
        self.at = there

    def _step(self, at):
        at_joints = HOME | dict(zip(JOINTS, at, strict=True))
        lines = Tree(DESCRIPTION).places(ARM.links, at_joints)
        places = np.concatenate([np.linspace(a, b, 3) for a, b in pairwise(lines)])
        self.looker.boxes = [FLOOR, *((place - HALF_M, place + HALF_M) for place in places)]
        self.reception.joints(at_joints.items())
        self.looker.stand(0.1)

    def why_not_home(self):
        now_s = self.looker.now_s
        home = Motion(tuple(JOINTS), (tuple(RAISED), tuple(FOLDED)))
        return self.room.refuse(self.posture.sweep(home, now_s), now_s)


@pytest.mark.parametrize("description", [DESCRIPTION, without_hand()], ids=["whole", "without hand"])
def test_an_arm_goes_home_again_and_the_robot_drives(monkeypatch, description):
    """Regression: "depth, remembered, 0.08 m ahead", and `home` and driving refused for ever."""
    robot = Robot(monkeypatch, description)
    robot.stay(0.2)
    robot.move(RAISED)
    robot.move(AHEAD)
    robot.stay(1.2)
    assert robot.why_not_home() is None
    robot.move(RAISED)
    robot.move(FOLDED)
    robot.stay(1.0)
    assert robot.looker.decide(0.5).code == "free"
