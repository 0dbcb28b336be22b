"""The simulated robot's looks: simple shapes on the links of its description. Metres, radians."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.simulator.joints.arm import SEGMENTS
from robots.simulator.joints.frames import Frame, Vector, frames, place, urdf
from robots.simulator.joints.joint_table import HOME
from robots.simulator.sensors.body import Body

WHITE, GREY, DARK = "0.90 0.91 0.89 1", "0.55 0.58 0.60 1", "0.16 0.18 0.20 1"
_JOINT_M = 0.012  # a joint's radius minus the arm's radius
_FINGERS = {"gripper_left_finger_link": 1.0, "gripper_right_finger_link": -1.0}
_HAND = "gripper_grasping_frame"


def description(body: Body, name: str) -> str:
    """Return the robot's description (URDF) with shapes that people recognise."""
    robot = ElementTree.fromstring(urdf(body, name))  # noqa: S314 - our own text
    links = {link.get("name", ""): link for link in robot.findall("link")}
    for visual in robot.iterfind("link/visual"):
        _colour(visual, DARK)
    if body.upper_body:
        _dress(links, frames(body))
    return ElementTree.tostring(robot, encoding="unicode")


def _dress(links: dict[str, Element], table: Sequence[Frame]) -> None:
    for hull in ("torso_hull", "head_hull"):  # these hulls do not move; the shapes below do, and replace them
        links[hull].remove(_found(links[hull].find("visual")))
    base, torso = links["base_link"], links["torso_lift_link"]
    _cylinder(base, (-0.062, 0.0, 0.50), 0.13, 0.42, GREY)
    _box(torso, (0.0, 0.0, -0.16), (0.24, 0.30, 0.38), WHITE)
    _cylinder(torso, (0.12, 0.0, -0.01), 0.09, 0.08, WHITE)
    _cylinder(links["head_1_link"], (0.0, 0.0, 0.05), 0.05, 0.10, DARK)
    head = links["head_2_link"]
    _box(head, (-0.01, 0.0, 0.07), (0.16, 0.20, 0.16), WHITE)
    _box(head, (0.072, 0.0, 0.07), (0.01, 0.17, 0.12), DARK)
    _box(head, (0.045, 0.0, 0.178), (0.04, 0.18, 0.035), DARK)
    for segment in SEGMENTS:
        end = place(table, segment.end, HOME, root=segment.begin).origin
        _rod(links[segment.begin], (float(end[0]), float(end[1]), float(end[2])), segment.radius)
    _box(links[_HAND], (0.0, 0.0, -0.11), (0.06, 0.14, 0.08), GREY)
    for finger, side in _FINGERS.items():
        if finger in links:
            _box(links[finger], (0.0, 0.0, 0.0), (0.03, 0.015, 0.09), DARK)
        else:
            _box(links[_HAND], (0.0, side * 0.03, -0.03), (0.03, 0.015, 0.09), DARK)


def _rod(link: Element, end: Vector, radius: float) -> None:
    """Add a joint at the link's origin, and a cylinder from there to `end`."""
    x, y, z = end
    length = math.hypot(x, y, z)
    _sphere(link, radius + _JOINT_M, DARK)
    rpy = (0.0, math.acos(z / length), math.atan2(y, x))
    _cylinder(link, (x / 2.0, y / 2.0, z / 2.0), radius, length, WHITE, rpy)


def _box(link: Element, at: Vector, size: Vector, colour: str) -> None:
    SubElement(_visual(link, at, colour), "box", size=_text(size))


def _sphere(link: Element, radius: float, colour: str) -> None:
    SubElement(_visual(link, (0.0, 0.0, 0.0), colour), "sphere", radius=f"{radius:g}")


def _cylinder(
    link: Element, at: Vector, radius: float, length: float, colour: str, rpy: Vector = (0.0, 0.0, 0.0)
) -> None:
    geometry = _visual(link, at, colour, rpy)
    SubElement(geometry, "cylinder", radius=f"{radius:g}", length=f"{length:g}")


def _visual(link: Element, at: Vector, colour: str, rpy: Vector = (0.0, 0.0, 0.0)) -> Element:
    """Return the geometry of a new shape on the link."""
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=_text(at), rpy=_text(rpy))
    geometry = SubElement(visual, "geometry")
    _colour(visual, colour)
    return geometry


def _colour(visual: Element, colour: str) -> None:
    material = SubElement(visual, "material", name=f"colour {colour}")
    SubElement(material, "color", rgba=colour)


def _text(values: Vector) -> str:
    return " ".join(f"{value:.5g}" for value in values)


def _found(element: Element | None) -> Element:
    assert element is not None  # noqa: S101 - our own text has it
    return element
