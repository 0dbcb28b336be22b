"""The part of a robot's description that a page draws."""

from __future__ import annotations

import pytest

from robots.bridge.tasks.urdf import BadDescription, parsed
from robots.description.drawable import drawable
from robots.simulator.joints.frames import frames
from robots.simulator.joints.looks import description
from robots.simulator.sensors.body import BODIES

SHAPE = '<visual><geometry><box size="1 2 3"/></geometry></visual>'


def robot(inside: str) -> str:
    return f'<robot name="r"><link name="base">{SHAPE}</link>{inside}</robot>'


def joint(name: str, parent: str, child: str, more: str = "", kind: str = "revolute") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


@pytest.mark.parametrize("kind", BODIES)
def test_each_simulated_robot_has_shapes_and_can_be_drawn(kind):
    found = drawable(description(BODIES[kind], "tiago-1"))
    assert found.problems == found.meshes == []
    links = parsed(found.urdf).findall("link")
    assert {frame.child for frame in frames(BODIES[kind])} <= {link.get("name") for link in links}
    assert any(link.findall("visual") for link in links)


def test_a_tiago_has_shapes_on_torso_head_arm_and_gripper():
    found = parsed(drawable(description(BODIES["tiago"], "tiago-1")).urdf)
    dressed = {link.get("name") for link in found.findall("link") if link.find("visual") is not None}
    arm = {f"arm_{number}_link" for number in (1, 2, 3, 4, 6)}
    assert dressed >= {"base_link", "torso_lift_link", "head_2_link", "gripper_grasping_frame", *arm}


def test_what_a_page_does_not_draw_is_left_out():
    more = "<gazebo><plugin/></gazebo><transmission/>" + joint("j", "base", "tip")
    texture = '<material name="m"><texture filename="http://elsewhere/x.png"/></material>'
    shown = drawable(robot(more + f"<link name='tip'><inertial/><collision/>{SHAPE}</link>" + texture)).urdf
    for word in ("gazebo", "transmission", "inertial", "collision", "texture", "elsewhere"):
        assert word not in shown


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "cannot be parsed"),
        ("<robot>", "cannot be parsed"),
        ("<svg/>", "is no <robot>"),
        ('<!DOCTYPE r [<!ENTITY a "aaaa">]><robot>&a;</robot>', "declarations"),
        ("<robot>" + " " * 8_000_000 + "</robot>", "too large"),
        (robot(joint("a", "base", "x") + joint("b", "x", "base")), "cycle"),
        (robot(joint("a", "base", "x") + joint("b", "other", "x")), "hangs on two joints"),
        (robot("".join(joint(f"j{n}", f"l{n}", f"l{n + 1}") for n in range(600))), "in a row"),
        (robot("".join(joint(f"j{n}", f"l{n + 1}", f"l{n}") for n in range(600))), "in a row"),
        (robot("".join(joint(f"j{n}", "base", f"l{n}") for n in range(2_001))), "more than 2000 joints"),
        (robot(joint("a", "base", "x", kind="magic")), "the type 'magic' is not known"),
        (robot(joint("a", "base", "x", '<origin xyz="0 nan 0"/>')), "'0 nan 0'"),
        (robot(joint("a", "base", "x", '<axis xyz="0 0 0"/>')), "its axis has no length"),
        (robot(joint("a", "base", "&quot;]")), "cannot be used"),
        (robot('<joint name="a" type="fixed"><child link="x"/></joint>'), "it has no parent"),
    ],
)
def test_a_description_that_cannot_be_used_says_why(text, why):
    with pytest.raises(BadDescription, match=why.replace("[", r"\[")):
        drawable(text)


@pytest.mark.parametrize(
    ("visual", "why"),
    [
        ("<geometry/>", "without geometry"),
        ('<geometry><box size="1 2"/></geometry>', "'1 2'"),
        ('<geometry><sphere radius="-1"/></geometry>', "is not positive"),
        ('<geometry><sphere radius="inf"/></geometry>', "'inf'"),
        ('<geometry><torus radius="1"/></geometry>', "'torus' is not known"),
        ('<geometry><mesh filename=""/></geometry>', "without a usable address"),
        ('<origin xyz="1e9 0 0"/><geometry><sphere radius="1"/></geometry>', "'1e9 0 0'"),
    ],
)
def test_a_shape_that_cannot_be_drawn_is_named_and_the_rest_drawn(visual, why):
    found = drawable(robot(joint("j", "base", "tip") + f'<link name="tip"><visual>{visual}</visual></link>'))
    (problem,) = found.problems
    assert problem.startswith("link tip: ")
    assert why in problem
    assert "box" in found.urdf


def test_thousands_of_faults_are_a_short_list():
    bad = "<visual><geometry/></visual>" * 3_000
    found = drawable(robot(f'<link name="tip">{bad}</link>'))
    assert (len(found.problems), found.problems[-1]) == (20, "and 1981 more")


def test_joints_that_follow_each_other_in_a_circle_follow_none():
    circle = joint("a", "base", "x", '<mimic joint="b"/>') + joint("b", "x", "y", '<mimic joint="a"/>')
    follower = joint("c", "y", "z") + joint("d", "z", "end", '<mimic joint="c" multiplier="-1"/>')
    shown = parsed(drawable(robot(circle + follower)).urdf)
    follows = {found.get("name") for found in shown.findall("joint") if found.find("mimic") is not None}
    assert follows == {"d"}
