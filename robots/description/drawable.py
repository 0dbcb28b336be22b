"""The part of a robot's description (URDF) that a page draws: links with their shapes, joints, colours.

Everything else is left out: collision, inertia, plug-ins, textures. Parts that cannot be drawn are listed as problems,
and the page shows the rest. Pure: no files, no database.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from robots.shared.sentences import Sentence, joined, reason_of, say
from robots.shared.urdf.document import FARTHEST_M, Misfit, description_of, name_of, numbers_of, origin_of
from robots.shared.urdf.joints import MOVING, Joint, Numbers, joints_of

MOST_SHAPES = 2_000
MOST_PROBLEMS = 20
MOST_MESHES = 500
_SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}}


class Drawable(NamedTuple):
    """The part of a description that a page draws."""

    urdf: str
    meshes: list[str]  # the addresses of meshes as in the description, each once
    problems: list[Sentence]  # about parts that are left out


def drawable(text: str) -> Drawable:
    """Return the part of this description that a page draws. Raises `BadDescription` if nothing of it can be drawn."""
    found = description_of(text)
    return _Reader(found.robot, found.problems).result()


class _Reader:
    def __init__(self, found: Element, problems: list[Sentence]) -> None:
        self._found = found
        self._robot = Element("robot", name="robot")
        self._meshes: dict[str, None] = {}
        self._problems = problems
        self._shapes = 0
        self._materials: dict[str, Element] = {}  # with a colour, by name

    def result(self) -> Drawable:
        tree = joints_of(self._found)
        self._problems += tree.problems
        materials = self._found.findall("material")
        if len(materials) > MOST_SHAPES:
            self._problems.append(say("more than {most} materials", most=MOST_SHAPES))
        for material in materials[:MOST_SHAPES]:
            self._read(self._material, material)
        visuals = self._visuals_by_link()
        for name in dict.fromkeys([tree.root, *(end for joint in tree.joints for end in joint[2:4])]):
            self._link(name, visuals.get(name, []))
        self._robot.extend(self._joints(tree.joints))
        self._add_materials()
        if len(self._problems) > MOST_PROBLEMS:
            more = len(self._problems) - MOST_PROBLEMS + 1
            self._problems[MOST_PROBLEMS - 1 :] = [say("and {count} more", count=more)]
        return Drawable(
            ElementTree.tostring(self._robot, encoding="unicode"), list(self._meshes), self._problems
        )

    def _read(self, read: Callable[[Element], Element], part: Element, *where: Sentence) -> list[Element]:
        """Return what `read` makes of the part; nothing, but a problem, if it cannot be used."""
        try:
            return [read(part)]
        except Misfit as misfit:
            self._problems.append(joined(": ", [*where, reason_of(misfit)]))
            return []

    # --- links -----------------------------------------------------------------------------------------

    def _visuals_by_link(self) -> dict[str, list[Element]]:
        visuals: dict[str, list[Element]] = {}
        for link in self._found.findall("link"):
            name = link.get("name", "")
            if name in visuals:
                text = "another link has the name {name}: only the first is drawn"
                self._problems.append(say(text, name=repr(name[:80])))
            visuals.setdefault(name, link.findall("visual"))
        return visuals

    def _link(self, name: str, visuals: list[Element]) -> None:
        link = SubElement(self._robot, "link", name=name)
        for visual in visuals:
            self._shapes += 1
            if self._shapes == MOST_SHAPES + 1:
                self._problems.append(say("more than {most} shapes", most=MOST_SHAPES))
            if self._shapes <= MOST_SHAPES:
                link.extend(self._read(self._visual, visual, say("link {name}", name=name[:80])))

    def _visual(self, visual: Element) -> Element:
        shown = Element("visual")
        shown.append(_origin(*origin_of(visual)))
        geometry = visual.find("geometry")
        shape = geometry[0] if geometry is not None and len(geometry) else None
        if shape is None:
            raise Misfit(say("a shape without geometry"))
        SubElement(shown, "geometry").append(self._shape(shape))
        material = visual.find("material")
        if material is not None:
            shown.extend(self._read(self._material, material))
        return shown

    def _shape(self, shape: Element) -> Element:
        if shape.tag == "mesh":
            return self._mesh(shape)
        if shape.tag not in _SIZES:
            raise Misfit(say("the shape {kind} is not known", kind=repr(shape.tag[:80])))
        sizes = {name: _size(shape, name, count) for name, count in _SIZES[shape.tag].items()}
        return Element(shape.tag, sizes)

    def _mesh(self, mesh: Element) -> Element:
        name = mesh.get("filename", "").strip()
        if not name or len(name) > 500 or not name.isprintable():
            raise Misfit(say("a mesh without a usable address"))
        scale = numbers_of(mesh, "scale", 3, "1 1 1")
        if not all(scale):
            raise Misfit(say("the scale {scale} of a <mesh> makes it flat", scale=repr(_text(scale))))
        if name not in self._meshes and len(self._meshes) >= MOST_MESHES:
            raise Misfit(say("one of more than {most} meshes", most=MOST_MESHES))
        self._meshes[name] = None
        return Element("mesh", filename=name, scale=_text(scale))

    def _material(self, material: Element) -> Element:
        """Return name and colour; a texture is left out. The first colour of a name holds wherever it is used."""
        name = material.get("name", "")[:200]
        shown = Element("material", name=name)
        colour = material.find("color")
        if colour is not None:
            rgba = tuple(min(max(part, 0.0), 1.0) for part in numbers_of(colour, "rgba", 4))
            SubElement(shown, "color", rgba=_text(rgba))
            if name:
                self._materials.setdefault(name, shown)
        return shown

    def _add_materials(self) -> None:
        """Add the colours by name; where a name has none, the page chooses the colour."""
        for visual in self._robot.iter("visual"):
            for material in visual.findall("material"):
                if len(material) == 0 and material.get("name") not in self._materials:
                    visual.remove(material)
        self._robot[:0] = self._materials.values()

    # --- joints ----------------------------------------------------------------------------------------

    def _joints(self, joints: list[Joint]) -> list[Element]:
        leaders = {
            joint.name for joint in joints if joint.kind in MOVING and joint.element.find("mimic") is None
        }
        return [self._joint(joint, leaders) for joint in joints]

    def _joint(self, joint: Joint, leaders: set[str]) -> Element:
        shown = Element("joint", name=joint.name, type=joint.kind)
        SubElement(shown, "parent", link=joint.parent)
        SubElement(shown, "child", link=joint.child)
        shown.append(_origin(joint.xyz, joint.rpy))
        if joint.kind in MOVING:
            SubElement(shown, "axis", xyz=_text(joint.axis))
            for tag, read in (("limit", _limit), ("mimic", lambda mimic: _mimic(mimic, leaders))):
                part = joint.element.find(tag)
                if part is not None:
                    shown.extend(self._read(read, part, say("joint {name}", name=repr(joint.name))))
        return shown


def _limit(limit: Element) -> Element:
    return Element("limit", {end: _text(numbers_of(limit, end, 1, "0")) for end in ("lower", "upper")})


def _mimic(mimic: Element, leaders: set[str]) -> Element:
    """Return whom the joint follows. A joint that itself follows leads none: a page could run into a cycle."""
    leader = name_of(mimic, "joint")
    if leader not in leaders:
        text = "it cannot follow {joint}, which does not move, or follows another joint itself"
        raise Misfit(say(text, joint=repr(leader[:80])))
    factors = {
        "multiplier": numbers_of(mimic, "multiplier", 1, "1"),
        "offset": numbers_of(mimic, "offset", 1, "0"),
    }
    return Element("mimic", {"joint": leader, **{name: _text(number) for name, number in factors.items()}})


def _origin(xyz: Numbers, rpy: Numbers) -> Element:
    return Element("origin", xyz=_text(xyz), rpy=_text(rpy))


def _size(shape: Element, name: str, count: int) -> str:
    sizes = numbers_of(shape, name, count, most=FARTHEST_M)
    if min(sizes) <= 0.0:
        raise Misfit(say("the {attribute} {value} is not positive", attribute=name, value=repr(_text(sizes))))
    return _text(sizes)


def _text(numbers: Numbers) -> str:
    return " ".join(f"{number:.6g}" for number in numbers)
