"""The part of a robot's description that a page draws."""

from __future__ import annotations

import time
from xml.etree.ElementTree import Element

import pytest

from robots.description.drawable import drawable
from robots.shared.urdf.document import BadDescription, description_of
from robots.simulator.joints.frames import frames
from robots.simulator.joints.looks import description
from robots.simulator.sensors.body import BODIES

BEHIND = ["the text behind the end of the robot is left out"]
SHAPE = '<visual><geometry><box size="1 2 3"/></geometry></visual>'


def robot(inside: str) -> str:
    return f'<robot name="r"><link name="base">{SHAPE}</link>{inside}</robot>'


def parsed(urdf: str) -> Element:
    return description_of(urdf).robot


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
    triangles = {"box": 12, "cylinder": 120, "sphere": 1740}  # as pages draw them
    assert sum(triangles[shape[0].tag] for shape in parsed(found.urdf).iter("geometry")) < 10_000


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
        (robot("".join(joint(f"j{n}", f"l{n}", f"l{n + 1}") for n in range(600))), "in a row"),
        (robot("".join(joint(f"j{n}", f"l{n + 1}", f"l{n}") for n in range(600))), "in a row"),
        (robot("".join(joint(f"j{n}", "base", f"l{n}") for n in range(2_001))), "more than 2000 joints"),
        ("<robot/>", "has no root"),
    ],
)
def test_a_description_that_cannot_be_used_says_why(text, why):
    with pytest.raises(BadDescription, match=why.replace("[", r"\[")):
        drawable(text)


# An arm whose joint "b" is bad: what hangs on it is left out, the rest is drawn.
@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (joint("b", "x", "y", kind="magic"), "the type 'magic' is not known: y is left out, with 1 more"),
        (joint("b", "x", "y", kind=""), "the type '' is not known"),
        (joint("b", "x", "y", '<axis xyz="0 0 0"/>'), "its axis has no length: y is left out, with 1 more"),
        (joint("b", "x", "y", '<axis xyz="0 1"/>'), "the xyz '0 1' of a <axis> cannot be used"),
        (joint("b", "x", "y", '<origin xyz="0 nan 0"/>'), "the xyz '0 nan 0' of a <origin>"),
        (joint("b", "x", "y", '<origin rpy="0 inf 0"/>'), "the rpy '0 inf 0'"),
        (joint("b", "x", "y", '<origin xyz="0 0 ${height}"/>'), "the xyz '0 0 ${height}'"),
        (joint("b", "x", "y", '<origin xyz="0,1 0 0"/>'), "the xyz '0,1 0 0'"),
        (joint("a", "x", "y"), "another joint has the same name"),
        (joint("", "x", "y"), "it has no name"),
        ('<joint name="b" type="fixed"><child link="y"/></joint>', "it has no parent"),
    ],
)
def test_a_joint_that_cannot_be_used_is_named_and_the_rest_drawn(bad, why):
    found = drawable(robot(joint("a", "base", "x") + bad + joint("c", "y", "z")))
    (problem,) = found.problems
    assert why in problem
    assert [link.get("name") for link in parsed(found.urdf).findall("link")] == ["base", "x"]


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (joint("b", "other", "x"), "'b': x hangs on joint 'a' already: it is left out"),
        (joint("b", "x", "&quot;]"), "the name '\"]' cannot be used"),
        ('<joint name="b" type="fixed"><parent link="x"/></joint>', "it has no child"),
        (joint("b", "y", "z"), "link 'y' hangs on no joint: y is left out, with 1 more"),
        (joint("b", "y", "z") + joint("c", "z", "y"), "a cycle of joints, with y in it, is left out"),
        (joint("b", "y", "y"), "a cycle of joints"),
        ("<link name='x'/><link name='x'/>", "another link has the name 'x'"),
        ("<link name='&quot;'/>", "a link has the name"),
    ],
)
def test_links_that_hang_on_nothing_of_the_robot_are_named(more, why):
    found = drawable(robot(joint("a", "base", "x") + more))
    assert any(why in problem for problem in found.problems)
    assert [link.get("name") for link in parsed(found.urdf).findall("link")] == ["base", "x"]


# As the exporter of SolidWorks and hand-written files have them, and RViz shows them.
@pytest.mark.parametrize(
    "more",
    [
        joint(
            "b", "x", "y", '<axis xyz="0 0 0"/><limit lower="0" upper="0" effort="0" velocity="0"/>', "fixed"
        ),
        joint("b", "x", "y", '<axis xyz="bad"/>', "fixed"),
        joint("b", "x", "y", "<axis/>"),
        joint("b", "x", "y", '<axis xyz="\t0\n 0  5 "/><origin xyz=" 1\t0\n0 "/>'),
        joint("b", "x", "y", '<origin rpy="0 0 1"/><limit effort="1"/>', "prismatic"),
        joint("b", "x", "y", '<origin xyz=""/><calibration rising="0"/><safety_controller k_velocity="0"/>'),
        joint("b", "x", "y", "<!-- a -- b <joint/> --><!---->")
        + "<!-- unused <link> --><xacro:if value='1'/>",
        joint("b", "x", "y", "<parent/>") + "<link name='y'><sensor:camera update='1'/>Pick & place</link>",
        joint("b", "x", "y") + f"<link name='y'><collision>{SHAPE}</collision></link><![CDATA[<joint/>]]>",
        joint("b", "x", "y") + "<link name='y'><visual><geometry><box size='1 1 1'/></geometry>"
        "<material name=''><texture filename=''/></material></visual></link>",
        joint("überarm’s", "x", "y"),
        joint("b", "x", "y", "<limit why='a < b'/>") + '<gazebo if = "1<2" unless="&lt;<&"/>\x0c\x00',
        joint("&#11;b&#x1F;", "x&#0;", "y&#xffff;", "<limit why='&#1114112; &#55296;'/>"),
    ],
)
def test_what_rviz_shows_is_drawn_without_a_word(more):
    found = drawable(robot(joint("a", "base", "x", '<axis xyz="0 0 2"/>') + more))
    assert found.problems == []
    shown = parsed(found.urdf)
    assert [link.get("name") for link in shown.findall("link")] == ["base", "x", "y"]
    axes = [axis.get("xyz") for axis in shown.iter("axis")]
    assert set(axes) <= {"0 0 1", "1 0 0"}


@pytest.mark.parametrize(
    ("before", "after", "problems"),
    [
        ("\ufeff", "", []),
        ("\n \t<?xml version='1.0' encoding='utf-16'?>\r\n", "\n\x00", []),
        ('<?xml version="1.1" encoding="latin-1" standalone="yes"?>', "<!-- end -->", []),
        ("<!DOCTYPE robot>", "", []),
        ("", "\n# end of file <a & b\x0b", BEHIND),
        ("", "<robot><link name='other'/></robot>", BEHIND),
        ("\x0b\x1b", "\x0b", []),
        ('<!DOCTYPE robot SYSTEM "file:///etc/passwd">', "", []),
    ],
)
def test_beginnings_and_ends_of_other_editors_are_read(before, after, problems):
    found = drawable(before + robot(joint("é", "base", "x")).replace("</robot>", "</robot >") + after)
    assert found.problems == problems
    assert "é" in found.urdf


def test_entities_stay_unexpanded():
    shown = drawable(robot("<link name='base'/>").replace('name="base"', 'name="&passwd;&amp;&#233;"'))
    assert 'name="&amp;passwd;&amp;é"' in shown.urdf


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_joint_that_floats_is_taken_as_fixed(kind):
    found = drawable(robot(joint("a", "base", "x", '<axis xyz="0 0 0"/>', kind)))
    assert found.problems == [f"joint 'a' is {kind}: it is taken as fixed"]
    assert parsed(found.urdf).find("joint").get("type") == "fixed"


@pytest.mark.parametrize(
    ("more", "left_out"),
    [('<mimic joint="ghost"/>', "mimic"), ("<mimic/>", "mimic"), ('<limit lower="${low}"/>', "limit")],
)
def test_a_bad_limit_or_mimic_is_named_and_its_joint_drawn(more, left_out):
    found = drawable(robot(joint("a", "base", "x", more)))
    (problem,) = found.problems
    assert problem.startswith("joint 'a': ")
    assert parsed(found.urdf).find(f"joint/{left_out}") is None


def test_a_colour_by_name_is_found_wherever_it_stands():
    def visual(material):
        return f"<visual><geometry><box size='1 1 1'/></geometry>{material}</visual>"

    red = visual('<material name="red"><color rgba="1 0 0 1"/></material>')
    named, nameless = (visual(f'<material name="{name}"/>') for name in ("red", "none"))
    more = f"<link name='x'>{named}{red}{nameless}</link>"
    shown = parsed(drawable(robot(joint("a", "base", "x") + more)).urdf)
    assert [material.get("name") for material in shown.findall("material")] == ["red"]
    named = [material.get("name") for material in shown.iter("material")]
    assert named == ["red", "red", "red"]


def test_mirrored_meshes_are_drawn_and_flat_ones_named():
    def mesh(scale):
        return f"<visual><geometry><mesh filename='a.stl' scale='{scale}'/></geometry></visual>"

    found = drawable(
        robot(joint("a", "base", "x") + f"<link name='x'>{mesh('1 -1 1')}{mesh('1 0 1')}</link>")
    )
    assert found.problems == ["link x: the scale '1 0 1' of a <mesh> makes it flat"]
    assert 'scale="1 -1 1"' in found.urdf


@pytest.mark.parametrize("bomb", ["<!--" * 500_000, "&" * 500_000, "<a>" * 100_000, " <?xml" * 300_000])
def test_hostile_texts_cost_no_time(bomb):
    begun_s = time.process_time()
    with pytest.raises(BadDescription):
        drawable("<robot>" + bomb)
    assert time.process_time() - begun_s < 3.0


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
    found = drawable(robot(joint("j", "base", "tip") + f'<link name="tip">{bad}</link>'))
    assert (len(found.problems), found.problems[-1]) == (20, "and 1981 more")


def test_joints_that_follow_each_other_in_a_circle_follow_none():
    circle = joint("a", "base", "x", '<mimic joint="b"/>') + joint("b", "x", "y", '<mimic joint="a"/>')
    follower = joint("c", "y", "z") + joint("d", "z", "end", '<mimic joint="c" multiplier="-1"/>')
    shown = parsed(drawable(robot(circle + follower)).urdf)
    assert sum("cannot follow" in problem for problem in drawable(robot(circle + follower)).problems) == 2
    follows = {found.get("name") for found in shown.findall("joint") if found.find("mimic") is not None}
    assert follows == {"d"}
