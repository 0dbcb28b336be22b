"""The simulated robot's looks: a TIAGo of boxes and cylinders on the links of its description. Metres, radians.

PAL's own meshes may not be shipped. Frames and collision shapes are those of `frames`: only what is seen is made here.
Pages without a graphics processor draw it, too: prefer few solids, and few that hide others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.simulator.joints.frames import Vector, urdf
from robots.simulator.sensors.body import Body

# Red, green, blue, opacity. Pages take them as amounts of light: 0.05 is a dark grey.
_WHITE, _GREY, _DARK, _BLACK = (
    "0.86 0.87 0.86 1",
    "0.30 0.32 0.34 1",
    "0.045 0.05 0.055 1",
    "0.012 0.013 0.015 1",
)
_LIGHT, _LENS = "0.02 0.45 0.62 1", "0.05 0.16 0.22 1"

Axis = Literal["x", "y", "z"]
_RPY: Mapping[Axis, Vector] = {
    "x": (0.0, math.pi / 2.0, 0.0),
    "y": (math.pi / 2.0, 0.0, 0.0),
    "z": (0.0, 0.0, 0.0),
}


class Solid(NamedTuple):
    """A solid on a link: colour, middle, shape and sizes as in URDF, the axis of a cylinder."""

    colour: str
    at: Vector
    shape: str
    sizes: dict[str, str]
    axis: Axis = "z"


def _box(colour: str, at: Vector, size: Vector) -> Solid:
    return Solid(colour, at, "box", {"size": _text(size)})


def _tube(colour: str, at: Vector, axis: Axis, radius: float, length: float) -> Solid:
    return Solid(colour, at, "cylinder", {"radius": f"{radius:g}", "length": f"{length:g}"}, axis)


def _text(values: Vector) -> str:
    return " ".join(f"{value:.5g}" for value in values)


# Where one solid hides another, it comes first: the hidden one then costs a page little.
_BASE = (  # PMB-2: cover, lid, bumper, band of light, slot of the laser
    _tube(_WHITE, (0.0, 0.0, 0.173), "z", 0.262, 0.200),
    _tube(_DARK, (0.0, 0.0, 0.276), "z", 0.205, 0.016),
    _tube(_DARK, (0.0, 0.0, 0.047), "z", 0.270, 0.056),
    _tube(_LIGHT, (0.0, 0.0, 0.152), "z", 0.266, 0.016),
    _tube(_BLACK, (0.178, 0.0, 0.096), "z", 0.090, 0.030),
)
_COLUMN = (  # carries the torso, and does not move
    _tube(_WHITE, (-0.062, 0.0, 0.370), "z", 0.120, 0.170),
    _box(_DARK, (-0.062, 0.0, 0.610), (0.150, 0.180, 0.320)),
)
_TORSO = (
    _tube(_WHITE, (0.160, 0.0, -0.035), "z", 0.105, 0.090),  # the chest reaches over the shoulder
    _box(_WHITE, (0.080, 0.0, -0.035), (0.160, 0.210, 0.090)),
    _tube(_WHITE, (-0.010, 0.045, -0.165), "z", 0.105, 0.350),
    _tube(_WHITE, (-0.010, -0.045, -0.165), "z", 0.105, 0.350),
    _box(_WHITE, (-0.010, 0.0, -0.165), (0.210, 0.090, 0.350)),
    _tube(_GREY, (0.155, 0.0, -0.090), "z", 0.070, 0.030),
    _box(_DARK, (-0.100, 0.0, -0.150), (0.040, 0.120, 0.220)),
    _box(_LIGHT, (0.095, 0.0, -0.300), (0.008, 0.080, 0.012)),
)
_NECK = (
    _tube(_GREY, (0.0, 0.0, 0.020), "z", 0.070, 0.016),
    _tube(_DARK, (0.0, 0.0, 0.055), "z", 0.048, 0.070),
)
_EYE_M = 0.042  # from the middle
_HEAD = (
    _tube(_WHITE, (-0.012, 0.0, 0.130), "y", 0.084, 0.200),
    _box(_WHITE, (-0.012, 0.0, 0.080), (0.168, 0.200, 0.100)),
    _tube(_GREY, (-0.012, 0.0, 0.130), "y", 0.048, 0.212),  # the ears
    _box(_BLACK, (0.066, 0.0, 0.122), (0.040, 0.180, 0.150)),
    _box(_DARK, (0.080, 0.0, 0.179), (0.030, 0.170, 0.038)),  # the camera of colours and depth
    *(_tube(_WHITE, (0.094, side, 0.179), "x", 0.016, 0.006) for side in (-_EYE_M, _EYE_M)),
    *(_tube(_LENS, (0.096, side, 0.179), "x", 0.012, 0.006) for side in (-_EYE_M, _EYE_M)),
    _box(_LIGHT, (0.086, 0.0, 0.085), (0.004, 0.070, 0.008)),
    _tube(_DARK, (0.0, 0.0, 0.010), "y", 0.040, 0.110),
)
_ARM = {
    "arm_1_link": (
        _tube(_WHITE, (0.0, 0.0, -0.020), "z", 0.062, 0.110),
        _tube(_WHITE, (0.060, 0.010, -0.031), "x", 0.046, 0.120),
    ),
    "arm_2_link": (
        _tube(_WHITE, (0.0, 0.0, 0.0), "z", 0.058, 0.120),
        _tube(_DARK, (0.0, 0.0, 0.0), "z", 0.044, 0.128),
        _tube(_WHITE, (0.055, 0.0, 0.0), "x", 0.050, 0.070),
    ),
    "arm_3_link": (
        _tube(_DARK, (0.0, 0.0, 0.0), "z", 0.046, 0.030),
        _tube(_WHITE, (-0.005, -0.002, -0.062), "z", 0.054, 0.100),
        _tube(_WHITE, (-0.012, 0.0, -0.155), "z", 0.049, 0.090),
    ),
    "arm_4_link": (
        _tube(_WHITE, (0.0, 0.0, 0.027), "z", 0.054, 0.112),
        _tube(_DARK, (0.0, 0.0, 0.027), "z", 0.041, 0.120),
        _tube(_WHITE, (-0.080, 0.016, 0.027), "x", 0.048, 0.130),
    ),
    "arm_5_link": (
        _tube(_DARK, (0.0, 0.0, 0.0), "z", 0.043, 0.034),
        _tube(_WHITE, (0.0, 0.0, 0.065), "z", 0.047, 0.100),
    ),
    "arm_6_link": (
        _tube(_DARK, (0.0, 0.0, 0.0), "z", 0.038, 0.092),
        _tube(_WHITE, (0.0, 0.0, 0.0), "z", 0.046, 0.060),
    ),
    "arm_7_link": (
        _tube(_WHITE, (0.0, 0.0, 0.060), "z", 0.042, 0.044),
        _tube(_GREY, (0.0, 0.0, 0.090), "z", 0.046, 0.016),
    ),
}
_FINGER_M = 0.032  # from the middle: half open
_GRIPPER = (
    _box(_DARK, (0.0, 0.0, -0.110), (0.062, 0.130, 0.066)),
    _box(_WHITE, (0.0, 0.0, -0.112), (0.070, 0.080, 0.045)),
    *(_box(_GREY, (0.0, side, -0.062), (0.030, 0.026, 0.034)) for side in (-_FINGER_M, _FINGER_M)),
    *(_box(_BLACK, (0.0, side, -0.012), (0.026, 0.014, 0.075)) for side in (-_FINGER_M, _FINGER_M)),
)
_TIAGO: Mapping[str, tuple[Solid, ...]] = {
    "base_link": (*_BASE, *_COLUMN),
    "torso_lift_link": _TORSO,
    "head_1_link": _NECK,
    "head_2_link": _HEAD,
    **_ARM,
    "gripper_grasping_frame": _GRIPPER,
}


def description(body: Body, name: str) -> str:
    """Return the robot's description (URDF) with shapes that people recognise."""
    robot = ElementTree.fromstring(urdf(body, name))  # noqa: S314 - our own text
    looks = _TIAGO if body.upper_body else {"base_link": _BASE} if body.wheels else {}
    for link in robot.findall("link"):
        for hull in link.findall("visual"):
            if looks:
                link.remove(hull)
            _paint(hull, _DARK)
        for solid in looks.get(link.get("name", ""), ()):
            _add(link, solid)
    return ElementTree.tostring(robot, encoding="unicode")


def _add(link: Element, solid: Solid) -> None:
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=_text(solid.at), rpy=_text(_RPY[solid.axis]))
    SubElement(SubElement(visual, "geometry"), solid.shape, solid.sizes)
    _paint(visual, solid.colour)


def _paint(visual: Element, colour: str) -> None:
    material = SubElement(visual, "material", name=f"colour {colour}")
    SubElement(material, "color", rgba=colour)
