"""The robot's frames: one table from which tf and the robot description are made. Metres, radians."""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.simulator.body import Body
from robots.simulator.joints import CAMERA_M, HEAD_PAN_M, HEAD_TILT_M, JOINTS, TORSO_M

_UP = (0.0, 0.0, 1.0)
OPTICAL_FRAME = "xtion_rgb_optical_frame"


Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]


class Frame(NamedTuple):
    """`child` hangs on `parent`, fixed or by a joint about or along `axis`."""

    parent: str
    child: str
    xyz: Vector
    rpy: Vector = (0.0, 0.0, 0.0)
    joint: str | None = None
    kind: str = "fixed"
    axis: Vector = _UP


def frames(body: Body) -> list[Frame]:
    """All frames of `body`, parents first."""
    base = "base_link"
    found = []
    if body.names.base_frame != base:
        found.append(Frame(body.names.base_frame, base, (0.0, 0.0, 0.0)))
    mounts = [(body.laser.frame, body.laser.pose), *((sonar.frame, sonar.pose) for sonar in body.sonars)]
    for frame, (x, y, z, yaw) in mounts:
        found.append(Frame(base, frame, (x, y, z), (0.0, 0.0, yaw)))
    if body.upper_body:
        found += _upper_body(base)
    return found


def _upper_body(base: str) -> list[Frame]:
    quarter = math.pi / 2.0
    return [
        Frame(base, "torso_lift_link", TORSO_M, joint="torso_lift_joint", kind="prismatic"),
        Frame("torso_lift_link", "head_1_link", HEAD_PAN_M, joint="head_1_joint", kind="revolute"),
        # A positive tilt looks up.
        Frame(
            "head_1_link",
            "head_2_link",
            HEAD_TILT_M,
            joint="head_2_joint",
            kind="revolute",
            axis=(0.0, -1.0, 0.0),
        ),
        Frame("head_2_link", "xtion_rgb_frame", CAMERA_M),
        Frame("xtion_rgb_frame", OPTICAL_FRAME, (0.0, 0.0, 0.0), (-quarter, 0.0, -quarter)),
    ]


def _rotation(rpy: Vector) -> Rotation:
    """Roll, pitch, yaw as a quaternion (x, y, z, w)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle / 2), math.sin(angle / 2)) for angle in rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def moved(frame: Frame, position: float) -> tuple[Vector, Rotation]:
    """Translation and rotation (x, y, z, w) of a frame whose joint is at `position`."""
    x, y, z = frame.xyz
    ax, ay, az = frame.axis
    if frame.kind == "fixed":
        return frame.xyz, _rotation(frame.rpy)
    if frame.kind == "prismatic":
        return (x + ax * position, y + ay * position, z + az * position), _rotation(frame.rpy)
    half = math.sin(position / 2.0)
    return frame.xyz, (ax * half, ay * half, az * half, math.cos(position / 2.0))


def urdf(body: Body, name: str) -> str:
    """A robot description with the frames above and the hull."""
    robot = Element("robot", name=name)
    for part in body.parts:
        link = SubElement(robot, "link", name="base_link" if part.name == "base" else f"{part.name}_hull")
        _hull(
            link, (*part.at, (part.bottom + part.top) / 2.0), part.radius, part.half, part.top - part.bottom
        )
        if part.name != "base":
            _join(robot, Frame("base_link", f"{part.name}_hull", (0.0, 0.0, 0.0)))
    links = {"base_link"}
    for frame in frames(body):
        for link_name in (frame.parent, frame.child):
            if link_name not in links:
                links.add(link_name)
                SubElement(robot, "link", name=link_name)
        _join(robot, frame)
    return ElementTree.tostring(robot, encoding="unicode")


def _hull(
    link: Element,
    centre: Vector,
    radius: float,
    half: tuple[float, float] | None,
    height: float,
) -> None:
    for kind in ("visual", "collision"):
        shape = SubElement(link, kind)
        SubElement(shape, "origin", xyz=_text(centre))
        geometry = SubElement(shape, "geometry")
        if half is None:
            SubElement(geometry, "cylinder", radius=f"{radius:g}", length=f"{height:g}")
        else:
            SubElement(geometry, "box", size=_text((2 * half[0], 2 * half[1], height)))


def _join(robot: Element, frame: Frame) -> None:
    name = frame.joint or f"{frame.child}_fixed"
    joint = SubElement(robot, "joint", name=name.replace(" ", "_"), type=frame.kind)
    SubElement(joint, "parent", link=frame.parent)
    SubElement(joint, "child", link=frame.child)
    SubElement(joint, "origin", xyz=_text(frame.xyz), rpy=_text(frame.rpy))
    if frame.joint:
        limits = JOINTS[frame.joint]
        SubElement(joint, "axis", xyz=_text(frame.axis))
        SubElement(
            joint,
            "limit",
            lower=f"{limits.low:g}",
            upper=f"{limits.high:g}",
            velocity=f"{limits.speed:g}",
            effort="0",
        )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)
