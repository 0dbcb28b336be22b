"""What joint states and motions tell of an arm, message by message; no master is needed."""

from __future__ import annotations

import io
import math
from types import SimpleNamespace

import pytest
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState

from robots.bridge.config import ArmSource
from robots.bridge.gate.posture import AT_HOME, UNKNOWN, Posture
from robots.bridge.gate.sweep import Motion
from robots.bridge.ros import posture
from robots.bridge.ros.posture import PostureTopics

ARM = ArmSource(
    home={"shoulder": 0.0, "elbow": 2.5},
    links=["upper", "lower", "hand"],
    postures={"offer": [(0.5, 0.0, 0.1)]},
)
OFFERED = Posture(at_home=False, discs=((0.5, 0.0, 0.1),))
DESCRIPTION = """<robot name="r">
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0.4 0 0"/></joint>
</robot>"""


class Listener:
    """The arm's topics without a master, at a time of its own."""

    def __init__(self, monkeypatch):
        self.now_s = 100.0
        self.told = []
        monkeypatch.setattr(posture.time, "monotonic", lambda: self.now_s)
        self.topics = PostureTopics(ARM, lambda arm, _: self.told.append(arm))

    def joints(self, **positions):
        raw = io.BytesIO()
        JointState(name=list(positions), position=list(positions.values())).serialize(raw)
        self.topics._hear(SimpleNamespace(_buff=raw.getvalue()))

    def begun(self, goal_id, motion):
        goal = SimpleNamespace(motion_name=motion)
        self.topics._begun(SimpleNamespace(goal_id=SimpleNamespace(id=goal_id), goal=goal))

    def ended(self, goal_id, status=GoalStatus.SUCCEEDED):
        status = SimpleNamespace(goal_id=SimpleNamespace(id=goal_id), status=status)
        self.topics._ended(SimpleNamespace(status=status))

    def after(self, seconds=0.2, **positions):
        self.now_s += seconds
        self.joints(**positions)
        return self.told[-1]


@pytest.fixture
def arm(monkeypatch):
    return Listener(monkeypatch)


def test_two_nodes_that_tell_of_some_joints_each_are_both_heard(arm):
    for _ in range(10):
        arm.after(0.1, gripper=0.04)
        arm.after(0.001, shoulder=0.0, elbow=2.5)
    assert arm.told[-1] == AT_HOME


def test_a_posture_is_told_ten_times_a_second_however_often_joints_are(arm):
    for _ in range(100):
        arm.after(0.01, shoulder=0.0, elbow=2.5)
    assert 9 <= len(arm.told) <= 11


@pytest.mark.parametrize("described", [True, False])
@pytest.mark.parametrize("position", [math.nan, math.inf])
def test_a_joint_that_is_nowhere_leaves_the_arm_unknown(arm, position, described):
    arm.topics.describe(DESCRIPTION if described else None)
    assert arm.after(shoulder=0.0, elbow=2.5) == AT_HOME
    assert arm.after(1.0, shoulder=position, elbow=2.5) == UNKNOWN
    wave = Motion(("shoulder",), ((1.0,),))
    assert arm.topics.sweep(wave, arm.now_s) == ((0.0, 0.0, ARM.reach_m),)


def test_a_motion_that_ended_as_it_should_leaves_the_arm_where_the_table_says(arm):
    arm.begun("a", "offer")
    assert arm.after(shoulder=1.0, elbow=0.0) == UNKNOWN
    arm.ended("a")
    assert arm.after(shoulder=1.0, elbow=0.0) == OFFERED
    arm.begun("b", "offer")
    arm.ended("b", GoalStatus.ABORTED)
    assert arm.after(shoulder=1.0, elbow=0.0) == UNKNOWN


@pytest.mark.parametrize("lost", ["", "never heard of again"])
def test_a_goal_whose_end_nobody_can_tell_spoils_no_later_one(arm, lost):
    arm.begun(lost, "offer")
    arm.ended("/play_motion-1-100.0")
    assert arm.after(shoulder=1.0, elbow=0.0) == UNKNOWN
    arm.begun("b", "offer")
    arm.ended("b")
    assert arm.after(shoulder=1.0, elbow=0.0) == OFFERED


def test_the_end_of_an_older_goal_tells_nothing_of_where_the_newest_leaves_the_arm(arm):
    arm.begun("a", "offer")
    arm.begun("b", "wave")
    arm.ended("a")
    assert arm.after(shoulder=1.0, elbow=0.0) == UNKNOWN
