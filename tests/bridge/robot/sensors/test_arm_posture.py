"""The arm's posture from joint states and goals, message by message."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml

from robots.bridge.arm.posture import END_M, HAND_M, MOST_LINKS, SHOULDER_M, ArmPosture
from robots.bridge.arm.tree import Tree
from robots.bridge.gate.arm.discs import AT_HOME, UNKNOWN, Posture
from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.robot.sensors import joints
from robots.bridge.robot.sensors.joints import JointReception
from robots.bridge.tasks.motions import recorded
from robots.shared.configuration.bridge_config import ArmSource
from robots.simulator.joints.joint_table import HOME, JOINTS
from tests.processes import REPOSITORY
from tests.ros import tiago_arm
from tests.ros.tiago_arm import HAND, without_hand

MOTIONS = REPOSITORY / "robots/simulator/joints/motions.yaml"
ARM = ArmSource(
    home={"shoulder": 0.0, "elbow": 2.5},
    links=["upper", "lower", "hand"],
    postures={"offer": [(0.5, 0.0, 0.1)]},
)
OFFERED = Posture(at_home=False, discs=((0.5, 0.0, 0.1),))
NOWHERE = UNKNOWN._replace(reach=(0.0, 0.0, ARM.reach_m + END_M))
DESCRIPTION = """<robot name="r">
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0.4 0 0"/></joint>
</robot>"""


def covers(disc, other):
    """Return whether a disc covers another one."""
    (x, y, radius), (other_x, other_y, other_radius) = disc, other
    return math.hypot(x - other_x, y - other_y) + other_radius <= radius


@pytest.mark.parametrize("description", [tiago_arm.DESCRIPTION, without_hand(), None])
@pytest.mark.parametrize("starved", [{}, dict.fromkeys(HOME, 0.0)])
def test_starved_of_joints_a_motion_needs_more_space_not_less(description, starved):
    motions = recorded(yaml.safe_load(MOTIONS.read_text()))
    fresh, hungry = ArmPosture(tiago_arm.ARM), ArmPosture(tiago_arm.ARM)
    fresh.describe(tiago_arm.DESCRIPTION)
    hungry.describe(description)
    fresh.update(HOME.items(), 10.0)
    hungry.update(starved.items(), 9.0)  # older than they may be
    for name, motion in motions.items():
        for known in (motion, None):  # its points may be unknown, too
            space = hungry.sweep(known, 10.0)
            needed = fresh.sweep(motion, 10.0)
            assert all(any(covers(disc, one) for disc in space) for one in needed), name


def test_why_the_arms_position_is_unknown():
    posture = ArmPosture(tiago_arm.ARM)
    posture.update(HOME.items(), 10.0)
    assert posture.problem(10.0) == "the robot’s description has not been read yet"
    posture.awaits_description = False
    assert posture.problem(10.4) == ""
    arm_first = next(iter(tiago_arm.ARM.home))
    stale = ArmPosture(tiago_arm.ARM)
    stale.awaits_description = False
    assert stale.problem(10.0) == "no joint states have come yet"
    stale.update(HOME.items(), 10.0)
    stale.update([(name, place) for name, place in HOME.items() if name != arm_first], 10.8)
    assert stale.problem(10.8) == "its joint states are 0.8 s old"


class Listener:
    """The arm's messages, with a fake clock."""

    def __init__(self, monkeypatch):
        self.now_s = 100.0
        self.postures = []
        monkeypatch.setattr(joints.time, "monotonic", lambda: self.now_s)
        self.use(ARM)

    def use(self, source):
        self.posture = ArmPosture(source)
        self.reception = JointReception(self.posture, lambda arm, _: self.postures.append(arm))

    def begun(self, goal_id, motion):
        self.reception.begun(goal_id, motion)

    def ended(self, goal_id, succeeded=True):
        self.reception.ended(goal_id, succeeded)

    def after(self, seconds=0.2, **positions):
        self.now_s += seconds
        self.reception.joints(positions.items())
        return self.postures[-1]


@pytest.fixture
def arm(monkeypatch):
    return Listener(monkeypatch)


def test_joint_states_of_two_nodes_are_combined(arm):
    for _ in range(10):
        arm.after(0.1, gripper=0.04)
        arm.after(0.001, shoulder=0.0, elbow=2.5)
    assert arm.postures[-1] == AT_HOME


def test_a_posture_is_sent_ten_times_a_second(arm):
    for _ in range(100):
        arm.after(0.01, shoulder=0.0, elbow=2.5)
    assert 9 <= len(arm.postures) <= 11


@pytest.mark.parametrize("described", [True, False])
@pytest.mark.parametrize("position", [math.nan, math.inf])
def test_a_joint_that_is_nowhere_leaves_the_arm_unknown(arm, position, described):
    arm.posture.describe(DESCRIPTION if described else None)
    assert arm.after(shoulder=0.0, elbow=2.5) == AT_HOME
    assert arm.after(1.0, shoulder=position, elbow=2.5) == NOWHERE
    wave = Motion(("shoulder",), ((1.0,),))
    whole_m = ARM.reach_m + ARM.radius_m + END_M + SHOULDER_M
    assert arm.posture.sweep(wave, arm.now_s) == (pytest.approx((0.0, 0.0, whole_m)),)


def test_a_finished_motion_leaves_the_arm_as_its_table_says(arm):
    arm.begun("a", "offer")
    assert arm.after(shoulder=1.0, elbow=0.0) == NOWHERE
    arm.ended("a")
    assert arm.after(shoulder=1.0, elbow=0.0) == OFFERED
    arm.begun("b", "offer")
    arm.ended("b", False)
    assert arm.after(shoulder=1.0, elbow=0.0) == NOWHERE


@pytest.mark.parametrize("lost", ["", "never heard of again"])
def test_a_goal_with_unknown_end_affects_no_later_one(arm, lost):
    arm.begun(lost, "offer")
    arm.ended("/play_motion-1-100.0")
    assert arm.after(shoulder=1.0, elbow=0.0) == NOWHERE
    arm.begun("b", "offer")
    arm.ended("b")
    assert arm.after(shoulder=1.0, elbow=0.0) == OFFERED


def test_points_seen_during_arm_motion_may_be_the_arm(arm):
    arm.posture.describe(DESCRIPTION)
    moving = [arm.after(shoulder=0.1 * step, elbow=0.0).reach for step in range(5)]
    assert moving == [(0.0, 0.0, ARM.reach_m + END_M)] * 5
    resting = [arm.after(shoulder=0.4, elbow=0.001 * step).reach for step in range(5)]
    assert resting == [None] * 5


def test_an_unreported_gripper_joint_does_not_move_the_arm(arm):
    finger = """<joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/>
      <origin xyz="0.1 0 0"/><axis xyz="0 1 0"/></joint></robot>"""
    arm.posture.describe(DESCRIPTION.replace("</robot>", finger))
    known = arm.after(shoulder=0.0, elbow=0.0)
    assert max(x for x, _, _ in known.discs) == pytest.approx(0.8)
    posture = arm.after(shoulder=0.0, elbow=0.0, grip=0.05)
    assert max(x for x, _, _ in posture.discs) == pytest.approx(0.9)
    assert len(posture.ends) == 1 and posture.ends[0][:2] == pytest.approx((0.9, 0.05))


@pytest.mark.parametrize("lacks_hand", [True, False])
def test_the_hand_belongs_to_the_arm_without_description(arm, lacks_hand):
    """Regression: a hand that the description lacks remained an obstacle for ever after `wave`."""
    arm.use(tiago_arm.ARM)
    arm.posture.describe(without_hand() if lacks_hand else tiago_arm.DESCRIPTION)
    random = np.random.default_rng(3)
    for _ in range(30):
        joints = HOME | {
            joint: random.uniform(JOINTS[joint].low, JOINTS[joint].high) for joint in tiago_arm.JOINTS
        }
        posture = arm.after(**joints)
        x, y, _ = Tree(tiago_arm.DESCRIPTION).places([HAND], joints)[0]
        assert posture.discs is not None
        discs = np.array([*posture.discs, *posture.ends])
        assert (np.hypot(discs[:, 0] - x, discs[:, 1] - y) < discs[:, 2]).any()
        if lacks_hand:
            assert any(radius > HAND_M for _, _, radius in posture.discs), "the hull has it too"


def test_an_arm_of_a_thousand_links_is_sampled(arm):
    more = "".join(
        f'<joint name="j{n}" type="fixed"><parent link="hand"/><child link="f{n}"/></joint>'
        for n in range(1000)
    )
    arm.posture.describe(DESCRIPTION.replace("</robot>", f"{more}</robot>"))
    assert len(arm.posture._model.moved) == MOST_LINKS
    assert arm.after(shoulder=0.0, elbow=0.0).discs


def test_an_old_goals_end_does_not_place_the_arm(arm):
    arm.begun("a", "offer")
    arm.begun("b", "wave")
    arm.ended("a")
    assert arm.after(shoulder=1.0, elbow=0.0) == NOWHERE
