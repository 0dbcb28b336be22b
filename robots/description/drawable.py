"""The part of a robot's description (URDF) that a page draws: links with their shapes, joints, colours.

Everything else is left out: collision, inertia, plug-ins, textures. Parts that cannot be drawn are listed as problems,
and the page shows the rest. Pure: no files, no database.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.bridge.tasks.urdf import MAX_JOINTS, BadDescription, parsed

MOST_SHAPES = 2_000
MOST_PROBLEMS = 20
MOST_MESHES = 500
MOST_LOOSE = 100  # links without a joint
FARTHEST_M = 1_000.0
LARGEST_NUMBER = 1e6
DEEPEST = 500  # joints from a link to the root, because a page reads the tree by recursion
JOINT_KINDS = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")
_NAME = re.compile(r"[^\x00-\x1f\x7f\"'\\<>]{1,200}")  # a page puts names of links into selectors
_NUMBERS: dict[str, tuple[str, int]] = {"box": ("size", 3), "sphere": ("radius", 1)}


class Drawable(NamedTuple):
    """The part of a description that a page draws."""

    urdf: str
    meshes: list[str]  # the addresses of meshes as in the description, each once
    problems: list[str]  # sentences about parts that are left out


class _Misfit(ValueError):
    """A part that cannot be drawn; the text says why."""


def drawable(text: str) -> Drawable:
    """Return the part of this description that a page draws. Raises `BadDescription` if it is no robot description."""
    found = parsed(text)
    if found.tag != "robot":
        raise BadDescription("the robot’s description is no <robot>")
    return _Reader(found).result()


class _Reader:
    def __init__(self, found: Element) -> None:
        self._found = found
        self._robot = Element("robot", name="robot")
        self._meshes: dict[str, None] = {}
        self._problems: list[str] = []
        self._shapes = 0

    def result(self) -> Drawable:
        joints = list(self._joints())
        self._check_tree(joints)
        _drop_loose_mimics(joints)
        materials = self._found.findall("material")
        if len(materials) > MOST_SHAPES:
            self._problems.append(f"more than {MOST_SHAPES} materials")
        for material in materials[:MOST_SHAPES]:
            self._add(self._robot, material, _material)
        links = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child))
        shapes = {link.get("name", ""): link.findall("visual") for link in self._found.findall("link")}
        loose = [other for other in shapes if other not in links]
        if len(loose) > MOST_LOOSE:
            self._problems.append(f"{len(loose) - MOST_LOOSE} links that hang on no joint")
        for name in [*links, *loose[:MOST_LOOSE]]:
            self._link(name, shapes.get(name, []))
        self._robot.extend(joint.element for joint in joints)
        if len(self._problems) > MOST_PROBLEMS:
            more = len(self._problems) - MOST_PROBLEMS + 1
            self._problems[MOST_PROBLEMS - 1 :] = [f"and {more} more"]
        return Drawable(
            ElementTree.tostring(self._robot, encoding="unicode"), list(self._meshes), self._problems
        )

    def _joints(self) -> Iterator[_Joint]:
        found = self._found.findall("joint")
        if len(found) > MAX_JOINTS:
            raise BadDescription(f"the robot’s description has more than {MAX_JOINTS} joints")
        for joint in found:
            try:
                yield _joint(joint)
            except _Misfit as misfit:
                raise BadDescription(f"joint {joint.get('name', '')[:80]!r}: {misfit}") from misfit

    def _check_tree(self, joints: list[_Joint]) -> None:
        above = {joint.child: joint.parent for joint in joints}
        if len(above) < len(joints):
            raise BadDescription("a link of the robot’s description hangs on two joints")
        depths: dict[str, int] = {}
        for link in above:
            way = [link]
            while way[-1] in above and way[-1] not in depths:
                way.append(above[way[-1]])
                if len(way) > DEEPEST:
                    raise BadDescription(
                        f"the robot’s description contains a cycle, or more than {DEEPEST} joints in a row"
                    )
            top = depths.get(way[-1], 0)
            for steps, passed in enumerate(reversed(way)):
                depths[passed] = top + steps
        if max(depths.values(), default=0) > DEEPEST:
            raise BadDescription(f"the robot’s description has more than {DEEPEST} joints in a row")

    def _link(self, name: str, visuals: list[Element]) -> None:
        if not _NAME.fullmatch(name):
            self._problems.append(f"a link has the name {name[:80]!r}, with which it cannot be drawn")
            return
        link = SubElement(self._robot, "link", name=name)
        for visual in visuals:
            self._shapes += 1
            if self._shapes == MOST_SHAPES + 1:
                self._problems.append(f"more than {MOST_SHAPES} shapes")
            if self._shapes <= MOST_SHAPES:
                self._add(link, visual, self._visual, f"link {name[:80]}: ")

    def _add(self, to: Element, part: Element, read: object, where: str = "") -> None:
        try:
            to.append(read(part))  # type: ignore[operator]
        except _Misfit as misfit:
            self._problems.append(f"{where}{misfit}")

    def _visual(self, visual: Element) -> Element:
        shown = Element("visual")
        _origin(visual, shown)
        geometry = visual.find("geometry")
        shape = geometry[0] if geometry is not None and len(geometry) else None
        if shape is None:
            raise _Misfit("a shape without geometry")
        into = SubElement(shown, "geometry")
        if shape.tag in _NUMBERS:
            attribute, count = _NUMBERS[shape.tag]
            SubElement(into, shape.tag, {attribute: _sizes(shape, attribute, count)})
        elif shape.tag == "cylinder":
            sizes = {"radius": _sizes(shape, "radius", 1), "length": _sizes(shape, "length", 1)}
            SubElement(into, "cylinder", sizes)
        elif shape.tag == "mesh":
            name = shape.get("filename", "").strip()
            if not name or len(name) > 500 or not name.isprintable():
                raise _Misfit("a mesh without a usable address")
            if name not in self._meshes and len(self._meshes) >= MOST_MESHES:
                raise _Misfit(f"one of more than {MOST_MESHES} meshes")
            self._meshes[name] = None
            scale = {"scale": _numbers(shape, "scale", 3)} if shape.get("scale") else {}
            SubElement(into, "mesh", {"filename": name, **scale})
        else:
            raise _Misfit(f"the shape {str(shape.tag)[:80]!r} is not known")
        material = visual.find("material")
        if material is not None:
            self._add(shown, material, _material)
        return shown


class _Joint(NamedTuple):
    parent: str
    child: str
    element: Element


def _drop_loose_mimics(joints: list[_Joint]) -> None:
    """Remove each mimic of a joint that is itself a mimic, or missing, so that a page cannot run into a cycle."""
    leaders = {joint.element.get("name") for joint in joints if joint.element.find("mimic") is None}
    for joint in joints:
        mimic = joint.element.find("mimic")
        if mimic is not None and mimic.get("joint") not in leaders:
            joint.element.remove(mimic)


def _joint(joint: Element) -> _Joint:
    name, kind = _name(joint), joint.get("type", "")
    if kind not in JOINT_KINDS:
        raise _Misfit(f"the type {kind[:80]!r} is not known")
    shown = Element("joint", name=name, type=kind)
    ends = []
    for tag in ("parent", "child"):
        end = joint.find(tag)
        if end is None:
            raise _Misfit(f"it has no {tag}")
        ends.append(_name(end, "link"))
        SubElement(shown, tag, link=ends[-1])
    _origin(joint, shown)
    axis, limit, mimic = joint.find("axis"), joint.find("limit"), joint.find("mimic")
    if axis is not None:
        xyz = _numbers(axis, "xyz", 3, "1 0 0")
        if not any(map(float, xyz.split())):
            raise _Misfit("its axis has no length")
        SubElement(shown, "axis", xyz=xyz)
    if limit is not None:
        ranges = {end: _numbers(limit, end, 1, "0") for end in ("lower", "upper")}
        SubElement(shown, "limit", ranges)
    if mimic is not None:
        factors = {
            "multiplier": _numbers(mimic, "multiplier", 1, "1"),
            "offset": _numbers(mimic, "offset", 1, "0"),
        }
        if _name(mimic, "joint") != name:
            SubElement(shown, "mimic", {"joint": _name(mimic, "joint"), **factors})
    return _Joint(ends[0], ends[1], shown)


def _origin(of: Element, to: Element) -> None:
    origin = of.find("origin")
    if origin is not None:
        xyz = _numbers(origin, "xyz", 3, "0 0 0", FARTHEST_M)
        SubElement(to, "origin", xyz=xyz, rpy=_numbers(origin, "rpy", 3, "0 0 0"))


def _material(material: Element) -> Element:
    """Return name and colour; a texture is left out."""
    shown = Element("material", name=material.get("name", "")[:200])
    colour = material.find("color")
    if colour is not None:
        rgba = [min(max(float(part), 0.0), 1.0) for part in _numbers(colour, "rgba", 4).split()]
        SubElement(shown, "color", rgba=" ".join(f"{part:g}" for part in rgba))
    return shown


def _name(element: Element, attribute: str = "name") -> str:
    name = element.get(attribute, "")
    if not _NAME.fullmatch(name):
        raise _Misfit(f"the name {name[:80]!r} cannot be used")
    return name


def _sizes(element: Element, attribute: str, count: int) -> str:
    text = _numbers(element, attribute, count, most=FARTHEST_M)
    if min(map(float, text.split())) <= 0.0:
        raise _Misfit(f"the {attribute} {text!r} is not positive")
    return text


def _numbers(
    element: Element, attribute: str, count: int, default: str = "", most: float = LARGEST_NUMBER
) -> str:
    """Return the attribute's `count` numbers as text, rounded. Raises `_Misfit`."""
    text = element.get(attribute) or default
    try:
        numbers = [float(part) for part in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(math.isfinite(number) and abs(number) <= most for number in numbers):
        raise _Misfit(f"the {attribute} {text[:80]!r} of a <{str(element.tag)[:80]}> cannot be used")
    return " ".join(f"{number:.6g}" for number in numbers)
