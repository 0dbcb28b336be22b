"""A world and one robot, written as MuJoCo's XML.

Geometry groups: 0 objects that robots touch and sensors see; 3 the robot itself.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.simulator.joints.arm import SEGMENTS, lengths
from robots.simulator.joints.frames import frames
from robots.simulator.sensors.body import Body
from robots.simulator.worlds import Box, Chair, Person, Table, Wall, World

ROBOT_GROUP = 3
TIMESTEP_S = 0.005

_WALL = "0.85 0.85 0.82 1"
_WOOD = "0.62 0.46 0.30 1"
_STEEL = "0.35 0.37 0.40 1"
_CLOTH = "0.25 0.35 0.55 1"
_SKIN = "0.80 0.45 0.30 1"
_ROBOT = "0.95 0.95 0.95 1"
_CHAIR_LEG_M = 0.025
_GYRATION_M = 0.28


def scene_xml(world: World, body: Body) -> str:
    """MJCF of `world` with `body` at its origin, ready for `mujoco.MjModel.from_xml_string`."""
    root = Element("mujoco", model=world.name)
    SubElement(root, "compiler", angle="degree", autolimits="true")
    SubElement(root, "option", timestep=str(TIMESTEP_S), integrator="implicitfast", cone="elliptic")
    visual = SubElement(root, "visual")
    SubElement(visual, "quality", shadowsize="0")
    SubElement(visual, "headlight", ambient="0.5 0.5 0.5", diffuse="0.5 0.5 0.5")
    SubElement(visual, "map", znear="0.02", zfar="40")
    SubElement(visual, "global", offwidth="640", offheight="480")
    static = SubElement(root, "worldbody")
    _floor(static, world)
    for wall in world.walls:
        _wall(static, wall)
    for table in world.tables:
        _table(static, table)
    for chair in world.chairs:
        _chair(static, chair)
    for box in world.boxes:
        _box(static, box)
    for person in world.people:
        _person(static, person)
    _robot(static, body)
    return ElementTree.tostring(root, encoding="unicode")


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def _floor(parent: Element, world: World) -> None:
    """Seen by cameras and depth sensors; the robot is held upright by its joints and touches nothing here.

    Its contact type matches no other geometry. It needs one because MuJoCo bounds a body by its geometry with a contact
    type: without it, mj_multiRay hit the floor only behind other objects.
    """
    west, south, east, north = world.size
    SubElement(
        parent,
        "geom",
        name="floor",
        type="plane",
        pos=_numbers((west + east) / 2, (south + north) / 2, 0.0),
        size=_numbers((east - west) / 2, (north - south) / 2, 1.0),
        rgba="0.55 0.58 0.55 1",
        contype="0",
        conaffinity="2",
    )


def _solid(
    parent: Element,
    name: str,
    centre: tuple[float, float, float],
    size: tuple[float, float, float],
    rgba: str,
    yaw: float = 0.0,
) -> None:
    """A box of full extents `size` around `centre`."""
    SubElement(
        parent,
        "geom",
        name=name,
        type="box",
        pos=_numbers(*centre),
        size=_numbers(*(extent / 2 for extent in size)),
        euler=_numbers(0, 0, yaw),
        rgba=rgba,
    )


def _piece(parent: Element, name: str, at: tuple[float, float], yaw: float) -> Element:
    """A frame in which the parts of one piece of furniture are placed."""
    return SubElement(parent, "body", name=name, pos=_numbers(*at, 0.0), euler=_numbers(0, 0, yaw))


def _wall(parent: Element, wall: Wall) -> None:
    (x0, y0), (x1, y1) = wall.start, wall.end
    length = math.hypot(x1 - x0, y1 - y0)
    yaw = math.degrees(math.atan2(y1 - y0, x1 - x0))
    centre = ((x0 + x1) / 2, (y0 + y1) / 2, wall.height / 2)
    _solid(parent, wall.name, centre, (length, wall.thickness, wall.height), _WALL, yaw)


def _legs(parent: Element, name: str, half_x: float, half_y: float, thickness: float, height: float) -> None:
    for index, (x, y) in enumerate(
        ((half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y))
    ):
        _solid(parent, f"{name} leg {index + 1}", (x, y, height / 2), (thickness, thickness, height), _STEEL)


def _table(parent: Element, table: Table) -> None:
    piece = _piece(parent, table.name, table.at, table.yaw)
    length, width = table.size
    under = table.height - table.top_m
    top = (length, width, table.top_m)
    _solid(piece, f"{table.name} top", (0.0, 0.0, under + table.top_m / 2), top, _WOOD)
    if table.legs:
        inset = table.leg_m / 2 + 0.03
        _legs(piece, table.name, length / 2 - inset, width / 2 - inset, table.leg_m, under)


def _chair(parent: Element, chair: Chair) -> None:
    piece = _piece(parent, chair.name, chair.at, chair.yaw)
    half = chair.seat / 2
    _solid(
        piece, f"{chair.name} seat", (0.0, 0.0, chair.height - 0.02), (chair.seat, chair.seat, 0.04), _CLOTH
    )
    _solid(
        piece, f"{chair.name} back", (-half + 0.02, 0.0, chair.height + 0.25), (0.04, chair.seat, 0.4), _CLOTH
    )
    inset = half - _CHAIR_LEG_M / 2
    _legs(piece, chair.name, inset, inset, _CHAIR_LEG_M, chair.height - 0.04)


def _box(parent: Element, box: Box) -> None:
    centre = (*box.at, box.z + box.size[2] / 2)
    _solid(parent, box.name, centre, box.size, _WOOD, box.yaw)


def _person(parent: Element, person: Person) -> None:
    """Two legs, a trunk and a head on a mocap body: it moves through obstacles."""
    figure = SubElement(parent, "body", name=person.name, mocap="true", pos=_numbers(*person.at, 0.0))
    hips = person.height * 0.5
    for side, y in (("left", 0.1), ("right", -0.1)):
        _upright(figure, f"{person.name} {side} leg", (0.0, y), 0.07, 0.0, hips, _CLOTH)
    _upright(figure, f"{person.name} trunk", (0.0, 0.0), person.radius, hips, person.height - 0.3, _SKIN)
    _upright(figure, f"{person.name} head", (0.0, 0.0), 0.11, person.height - 0.3, person.height, _SKIN)


def _upright(
    parent: Element,
    name: str,
    at: tuple[float, float],
    radius: float,
    bottom: float,
    top: float,
    rgba: str,
) -> None:
    """An upright cylinder."""
    centre = _numbers(*at, (bottom + top) / 2)
    size = _numbers(radius, (top - bottom) / 2)
    SubElement(parent, "geom", name=name, type="cylinder", pos=centre, size=size, rgba=rgba)


def _robot(parent: Element, body: Body) -> None:
    """Three joints hold the body upright and let it slide and turn; forces drive it (see `physics`)."""
    robot = SubElement(parent, "body", name="robot")
    for name, kind, axis in (("x", "slide", "1 0 0"), ("y", "slide", "0 1 0"), ("yaw", "hinge", "0 0 1")):
        SubElement(robot, "joint", name=f"robot {name}", type=kind, axis=axis)
    inertia = _numbers(*[0.5 * body.mass_kg * _GYRATION_M**2] * 3)
    SubElement(robot, "inertial", pos="0 0 0.3", mass=str(body.mass_kg), diaginertia=inertia)
    for part in body.parts:
        name = f"robot {part.name}"
        if part.half is not None:
            centre = (*part.at, (part.bottom + part.top) / 2)
            _solid(robot, name, centre, (2 * part.half[0], 2 * part.half[1], part.top - part.bottom), _ROBOT)
        else:
            _upright(robot, name, part.at, part.radius, part.bottom, part.top, _ROBOT)
    if body.upper_body:
        _arm(robot, body)
    for geom in robot.iter("geom"):
        geom.set("group", str(ROBOT_GROUP))
        # Smooth covers: the robot slides along obstacles instead of sticking to them.
        geom.set("friction", "0.3 0.005 0.0001")


def _arm(robot: Element, body: Body) -> None:
    """A body for each capsule, without joints or mass: `physics` places them by the joints."""
    for segment, length in zip(SEGMENTS, lengths(frames(body)), strict=True):
        name = f"robot {segment.name}"
        size = _numbers(segment.radius, length / 2.0)
        piece = SubElement(robot, "body", name=name)
        SubElement(piece, "geom", name=name, type="capsule", size=size, mass="0", rgba=_ROBOT)
