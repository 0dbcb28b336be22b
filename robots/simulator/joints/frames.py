"""The robot's frames: one table from which tf and the robot description are made. Metres, radians."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from robots.simulator.joints.joint_table import CAMERA_M, HEAD_PAN_M, HEAD_TILT_M, JOINTS, TORSO_M
from robots.simulator.sensors.body import Body

_UP = (0.0, 0.0, 1.0)
_TO_OPTICAL = (-math.pi / 2.0, 0.0, -math.pi / 2.0)  # from x ahead, z up to z ahead, x right
CAMERA_FRAME = "xtion_rgb_frame"
OPTICAL_FRAME = "xtion_rgb_optical_frame"


Vector = tuple[float, float, float]
Rotation = tuple[float, float, float, float]
Matrix = NDArray[np.float64]


class FrameError(ValueError):
    """The frame does not exist."""


class Frame(NamedTuple):
    """`child` is attached to `parent`, fixed or by a joint about or along `axis`."""

    parent: str
    child: str
    xyz: Vector
    rpy: Vector = (0.0, 0.0, 0.0)
    joint: str | None = None
    kind: str = "fixed"
    axis: Vector = _UP


class Placed(NamedTuple):
    """A frame's pose in another frame: its origin (3,), and its axes as columns (3, 3)."""

    origin: Matrix
    axes: Matrix

    def point(self, inside: Matrix) -> Matrix:
        """Transform a point of this frame to the other frame."""
        return self.origin + self.axes @ inside


def frames(body: Body) -> list[Frame]:
    """Return all frames of `body`, parents first."""
    base = "base_link"
    found = []
    if body.names.base_frame != base:
        found.append(Frame(body.names.base_frame, base, (0.0, 0.0, 0.0)))
    mounts = [(body.laser.frame, body.laser.pose), *((sonar.frame, sonar.pose) for sonar in body.sonars)]
    for frame, (x, y, z, yaw) in mounts:
        found.append(Frame(base, frame, (x, y, z), (0.0, 0.0, yaw)))
    if body.upper_body:
        found += _upper_body(base)
    if body.rear_camera is not None:
        x, y, z, yaw, pitch = body.rear_camera.pose
        link = body.rear_camera.link
        found.append(Frame(base, link, (x, y, z), (0.0, pitch, yaw)))
        found.append(Frame(link, body.rear_camera.optical_frame, (0.0, 0.0, 0.0), _TO_OPTICAL))
    return found


def _upper_body(base: str) -> list[Frame]:
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
        Frame("head_2_link", CAMERA_FRAME, CAMERA_M),
        Frame(CAMERA_FRAME, OPTICAL_FRAME, (0.0, 0.0, 0.0), _TO_OPTICAL),
        *_arm("torso_lift_link"),
    ]


def _arm(shoulder: str) -> list[Frame]:
    """Return the frames of seven joints, each about its own z, and of the point between the fingers."""
    quarter = math.pi / 2.0
    joints: list[tuple[Vector, Vector]] = [
        ((0.155, 0.014, -0.151), (0.0, 0.0, -quarter)),
        ((0.125, 0.0195, -0.031), (-quarter, 0.0, 0.0)),
        ((0.0895, 0.0, -0.0015), (-quarter, 0.0, quarter)),
        ((-0.02, -0.027, -0.222), (-quarter, -quarter, 0.0)),
        ((-0.162, 0.02, 0.027), (0.0, -quarter, 0.0)),
        ((0.0, 0.0, 0.15), (-quarter, -quarter, 0.0)),
        ((0.0, 0.0, 0.0), (quarter, 0.0, quarter)),
    ]
    links = [shoulder, *(f"arm_{number}_link" for number in range(1, 8))]
    found = [
        Frame(parent, child, xyz, rpy, joint=child.replace("link", "joint"), kind="revolute")
        for (parent, child), (xyz, rpy) in zip(pairwise(links), joints, strict=True)
    ]
    return [*found, Frame(links[-1], "gripper_grasping_frame", (0.0, 0.0, 0.24))]


def _rotation(rpy: Vector) -> Rotation:
    """Return roll, pitch, yaw as a quaternion (x, y, z, w)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle / 2), math.sin(angle / 2)) for angle in rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def moved(frame: Frame, position: float) -> tuple[Vector, Rotation]:
    """Return translation and rotation (x, y, z, w) of a frame whose joint is at `position`."""
    x, y, z = frame.xyz
    ax, ay, az = frame.axis
    if frame.kind == "fixed":
        return frame.xyz, _rotation(frame.rpy)
    if frame.kind == "prismatic":
        return (x + ax * position, y + ay * position, z + az * position), _rotation(frame.rpy)
    half = math.sin(position / 2.0)
    turned = (ax * half, ay * half, az * half, math.cos(position / 2.0))
    return frame.xyz, _after(_rotation(frame.rpy), turned)


def _after(first: Rotation, then: Rotation) -> Rotation:
    """Combine two rotations; the second turns about the axes that the first has turned."""
    (ax, ay, az, aw), (bx, by, bz, bw) = first, then
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def place(table: Sequence[Frame], name: str, joints: Mapping[str, float], root: str | None = None) -> Placed:
    """Return the pose of frame `name` in its ancestor `root` (default: the root of all). Raises `FrameError`."""
    parents = {frame.child: frame for frame in table}
    placed = Placed(np.zeros(3), np.eye(3))
    at = name
    while at != root and at in parents:
        frame = parents[at]
        translation, rotation = moved(frame, joints[frame.joint] if frame.joint else 0.0)
        axes = _matrix(rotation)
        placed = Placed(np.array(translation) + axes @ placed.origin, axes @ placed.axes)
        at = frame.parent
    if at != root and (root is not None or all(frame.parent != at for frame in table)):
        raise FrameError(f"no frame {name!r}" + (f" on {root}" if root else ""))
    return placed


_UPPER_BODY = _upper_body("base_link")


def camera_pose(joints: Mapping[str, float]) -> Placed:
    """Return the pose of the head's camera in the base frame: axes forward, left, up. A positive tilt looks up."""
    return place(_UPPER_BODY, CAMERA_FRAME, joints)


def _matrix(rotation: Rotation) -> Matrix:
    """Return a unit quaternion (x, y, z, w) as a matrix."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def urdf(body: Body, name: str) -> str:
    """Return a robot description with the frames above and the hull."""
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
