"""Positions of links by the robot's description."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.bridge.arm.tree import Tree
from robots.shared.urdf.document import BadDescription
from robots.simulator.joints.frames import frames, place, urdf
from robots.simulator.joints.joint_table import HOME
from robots.simulator.sensors.body import BODIES

ARM = """<robot name="r">
  <joint name="lift" type="prismatic"><parent link="base"/><child link="torso"/><origin xyz="0 0 1"/>
    <axis xyz="0 0 2"/></joint>
  <joint name="shoulder" type="revolute"><parent link="torso"/><child link="upper"/>
    <origin xyz="0.2 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="hand" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0.4 0 0"/></joint>
</robot>"""


def test_links_are_where_their_joints_put_them():
    hand = Tree(ARM).places(["hand"], {"lift": 0.3, "shoulder": 0.0, "elbow": -math.pi / 2})[0]
    assert hand == pytest.approx([0.2 + 0.4, 0.5, 1.3])
    assert Tree(ARM).moving(["hand"]) == {"lift", "shoulder", "elbow"}


def test_the_simulated_robots_description_agrees_with_its_frames():
    body = BODIES["tiago"]
    tree, table = Tree(urdf(body, "tiago-1")), frames(body)
    positions = HOME | {"arm_1_joint": 1.2, "arm_2_joint": 0.4, "arm_4_joint": 0.7, "torso_lift_joint": 0.2}
    for link in ("arm_3_link", "arm_7_link", "gripper_grasping_frame", "head_2_link"):
        assert tree.places([link], positions)[0] == pytest.approx(
            place(table, link, positions).origin, abs=1e-5
        )


def test_many_moments_at_once_are_as_one_by_one():
    tree = Tree(urdf(BODIES["tiago"], "tiago-1"))
    links = ["arm_1_link", "arm_5_link", "gripper_grasping_frame"]
    moving = {"arm_2_joint": np.linspace(-1.0, 1.0, 7), "torso_lift_joint": np.linspace(0.0, 0.3, 7)}
    together = tree.places(links, HOME | moving)
    assert together.shape == (7, 3, 3)
    for moment in range(7):
        alone = tree.places(links, HOME | {joint: at[moment] for joint, at in moving.items()})
        assert together[moment] == pytest.approx(alone)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("no xml", "cannot be parsed"),
        ('<!DOCTYPE r [<!ENTITY a "a">]><robot/>', "contains declarations"),
        (ARM.replace('link="base"', 'link="hand"'), "cycle"),
        ("<robot>" + "<x/>" * 2_000_001 + "</robot>", "too large"),
    ],
)
def test_a_description_that_makes_no_sense_is_refused_in_words(text, why):
    with pytest.raises(BadDescription, match=why):
        Tree(text)


@pytest.mark.parametrize(
    ("part", "bad"),
    [
        ('xyz="0 0 2"', 'xyz="0 0 0"'),
        ('xyz="0 0 1"', 'xyz="0 nan 1"'),
        ('type="prismatic"', 'type="magic"'),
    ],
)
def test_the_place_of_what_hangs_on_a_bad_joint_is_unknown(part, bad):
    tree = Tree(ARM.replace(part, bad, 1))
    assert {"torso", "upper", "lower", "hand"} <= tree.unplaced
    assert "hand" not in tree
    with pytest.raises(BadDescription, match="'hand'"):
        tree.moving(["hand"])


def test_the_axis_of_a_fixed_joint_does_not_matter():
    arm = ARM.replace('<origin xyz="0.4 0 0"/></joint>', '<origin xyz="0.4 0 0"/><axis xyz="0 0 0"/></joint>')
    assert arm != ARM
    positions = {"lift": 0.3, "shoulder": 0.0, "elbow": -math.pi / 2}
    assert Tree(arm).places(["hand"], positions) == pytest.approx(Tree(ARM).places(["hand"], positions))


def test_a_missing_link_is_named():
    with pytest.raises(BadDescription, match="tentacle"):
        Tree(ARM).moving(["tentacle"])


def test_a_joint_without_a_position_is_named():
    with pytest.raises(KeyError, match="elbow"):
        Tree(ARM).places(["hand"], {"lift": 0.0, "shoulder": 0.0})
