"""A world and one robot, written as MuJoCo's XML.

Geometry groups: 0 objects that robots touch and sensors see; 3 the robot itself; 4 decoration for colour cameras.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.simulator.joints.arm import SEGMENTS, lengths
from robots.simulator.joints.frames import frames
from robots.simulator.sensors.body import Body
from robots.simulator.worlds import Box, Chair, Person, Table, Wall, World

OBJECT_GROUP = 0
ROBOT_GROUP = 3
DECORATION_GROUP = 4
TIMESTEP_S = 0.005

_WOOD = "0.62 0.46 0.30 1"
_STEEL = "0.35 0.37 0.40 1"
_TROUSERS = "0.20 0.24 0.35 1"
_SHIRT = "0.75 0.30 0.25 1"
_SKIN = "0.85 0.63 0.50 1"
_ROBOT = "0.95 0.95 0.95 1"
_SKIRTING = "0.25 0.27 0.30 1"
_SKIRTING_M = 0.10
_CHAIR_LEG_M = 0.025
_GYRATION_M = 0.28


def scene_xml(world: World, body: Body) -> str:
    """Return the MJCF of `world` with `body` at its origin, for `mujoco.MjModel.from_xml_string`."""
    root = Element("mujoco", model=world.name)
    SubElement(root, "compiler", angle="degree", autolimits="true")
    SubElement(root, "option", timestep=str(TIMESTEP_S), integrator="implicitfast", cone="elliptic")
    visual = SubElement(root, "visual")
    SubElement(visual, "quality", shadowsize="0", offsamples="0")
    SubElement(visual, "headlight", ambient="0.7 0.7 0.7", diffuse="0.3 0.3 0.3", specular="0 0 0")
    # Multiples of the world's extent. znear is small: a camera must not look through a wall at the hull.
    SubElement(visual, "map", znear="0.002", zfar="40")
    SubElement(visual, "global", offwidth="640", offheight="480")
    _materials(root)
    static = SubElement(root, "worldbody")
    # The light comes from a side, so that walls of different directions differ in brightness.
    SubElement(
        static, "light", directional="true", dir="0.4 0.7 -1", diffuse="0.3 0.3 0.28", castshadow="false"
    )
    _floor(static, world)
    for wall in world.walls:
        _slab(static, wall.name, wall, (wall.thickness, wall.height), _rgba(wall.colour))
    for table in world.tables:
        _table(static, table)
    for chair in world.chairs:
        _chair(static, chair)
    for box in world.boxes:
        _box(static, box)
    _decorate(static, world)
    for person in world.people:
        _person(static, person)
    _robot(static, body)
    return ElementTree.tostring(root, encoding="unicode")


def _materials(root: Element) -> None:
    """Add floor tiles of half a metre, whose edges show the robot's motion, ceiling panels, and the sky."""
    asset = SubElement(root, "asset")
    looks = {"tiles": ("0.62 0.63 0.61", "0.52 0.55 0.54"), "panels": ("0.88 0.88 0.86", "0.80 0.81 0.80")}
    for name, (bright, dark) in looks.items():
        SubElement(
            asset,
            "texture",
            name=name,
            type="2d",
            builtin="checker",
            rgb1=bright,
            rgb2=dark,
            mark="edge",
            markrgb="0.36 0.38 0.38",
            width="128",
            height="128",
        )
        SubElement(
            asset, "material", name=name, texture=name, texuniform="true", texrepeat="1 1", specular="0"
        )
    SubElement(
        asset,
        "texture",
        type="skybox",
        builtin="gradient",
        rgb1="0.75 0.82 0.90",
        rgb2="0.90 0.90 0.88",
        width="16",
        height="96",
    )


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def _rgba(colour: str) -> str:
    """Convert ``#rrggbb`` to MuJoCo's numbers."""
    return _numbers(*(value / 255.0 for value in bytes.fromhex(colour[1:])), 1.0)


def _floor(parent: Element, world: World) -> None:
    """Add the floor for cameras and depth sensors. The robot does not touch it: its joints hold it upright.

    The floor's contact type matches no other geometry. A contact type is needed because MuJoCo bounds a body
    by its geometry with a contact type: without one, mj_multiRay hit the floor only behind other objects.
    """
    _plane(parent, world, 0.0, name="floor", material="tiles", contype="0", conaffinity="2")


def _plane(parent: Element, world: World, z: float, **attributes: str) -> None:
    """Add a plane of the world's size at this height."""
    west, south, east, north = world.size
    centre = _numbers((west + east) / 2, (south + north) / 2, z)
    size = _numbers((east - west) / 2, (north - south) / 2, 1.0)
    SubElement(parent, "geom", attributes, type="plane", pos=centre, size=size)


def _decorate(parent: Element, world: World) -> None:
    """Add skirting boards, a ceiling and the world's decoration. No robot and no ray hits them."""
    group = SubElement(parent, "body", name="decoration")
    for wall in world.walls:
        _slab(group, f"{wall.name} skirting", wall, (wall.thickness + 0.02, _SKIRTING_M), _SKIRTING)
    for box in world.decoration:
        _box(group, box)
    if world.walls:
        highest = max(wall.height for wall in world.walls)
        _plane(group, world, highest, name="ceiling", euler="180 0 0", material="panels")
    for geom in group.iter("geom"):
        geom.set("group", str(DECORATION_GROUP))
        geom.set("contype", "0")
        geom.set("conaffinity", "0")


def _solid(
    parent: Element,
    name: str,
    centre: tuple[float, float, float],
    size: tuple[float, float, float],
    rgba: str,
    yaw: float = 0.0,
) -> None:
    """Add a box with the whole lengths `size` around `centre`."""
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
    """Add a frame for the parts of one piece of furniture."""
    return SubElement(parent, "body", name=name, pos=_numbers(*at, 0.0), euler=_numbers(0, 0, yaw))


def _slab(parent: Element, name: str, wall: Wall, size: tuple[float, float], rgba: str) -> None:
    """Add a slab along the line of `wall`; `size`: thickness and height."""
    thickness, height = size
    (x0, y0), (x1, y1) = wall.start, wall.end
    length = math.hypot(x1 - x0, y1 - y0)
    yaw = math.degrees(math.atan2(y1 - y0, x1 - x0))
    centre = ((x0 + x1) / 2, (y0 + y1) / 2, height / 2)
    _solid(parent, name, centre, (length, thickness, height), rgba, yaw)


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
    cloth = _rgba(chair.colour)
    _solid(
        piece, f"{chair.name} seat", (0.0, 0.0, chair.height - 0.02), (chair.seat, chair.seat, 0.04), cloth
    )
    _solid(
        piece, f"{chair.name} back", (-half + 0.02, 0.0, chair.height + 0.25), (0.04, chair.seat, 0.4), cloth
    )
    inset = half - _CHAIR_LEG_M / 2
    _legs(piece, chair.name, inset, inset, _CHAIR_LEG_M, chair.height - 0.04)


def _box(parent: Element, box: Box) -> None:
    centre = (*box.at, box.z + box.size[2] / 2)
    _solid(parent, box.name, centre, box.size, _rgba(box.colour), box.yaw)


def _person(parent: Element, person: Person) -> None:
    """Add two legs, a trunk and a head on a mocap body, which moves through obstacles."""
    figure = SubElement(parent, "body", name=person.name, mocap="true", pos=_numbers(*person.at, 0.0))
    hips = person.height * 0.5
    for side, y in (("left", 0.1), ("right", -0.1)):
        _upright(figure, f"{person.name} {side} leg", (0.0, y), 0.07, 0.0, hips, _TROUSERS)
    _upright(figure, f"{person.name} trunk", (0.0, 0.0), person.radius, hips, person.height - 0.3, _SHIRT)
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
    """Add an upright cylinder."""
    centre = _numbers(*at, (bottom + top) / 2)
    size = _numbers(radius, (top - bottom) / 2)
    SubElement(parent, "geom", name=name, type="cylinder", pos=centre, size=size, rgba=rgba)


def _robot(parent: Element, body: Body) -> None:
    """Add the robot. Three joints hold it upright, but let it slide and turn; `mujoco_world` applies forces."""
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
    """Add a body for each capsule, without joints or mass: `Physics.place_arm` places them."""
    for segment, length in zip(SEGMENTS, lengths(frames(body)), strict=True):
        name = f"robot {segment.name}"
        size = _numbers(segment.radius, length / 2.0)
        piece = SubElement(robot, "body", name=name)
        SubElement(piece, "geom", name=name, type="capsule", size=size, mass="0", rgba=_ROBOT)
