"""The joints of a description as a tree, from its root.

A joint that cannot be used is left out with all that hangs on it: the places of those links are not known. Links that
hang on no joint, such as a second robot, are left out too. RViz refuses some of these descriptions as a whole.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple
from xml.etree.ElementTree import Element

from robots.shared.urdf.document import BadDescription, Misfit, axis_of, is_name, name_of, origin_of

MAX_JOINTS = 2_000
DEEPEST = 500  # joints from a link to the root, because a page reads the tree by recursion
MOVING = ("revolute", "continuous", "prismatic")
FREE = ("floating", "planar")  # no node reports their positions: RViz, too, takes them as fixed

Numbers = tuple[float, ...]


class Joint(NamedTuple):
    """A joint that can be used. Metres and radians, in the parent link's frame."""

    name: str
    kind: str  # one of `MOVING`, or fixed
    parent: str
    child: str
    xyz: Numbers
    rpy: Numbers
    axis: Numbers  # of length 1
    element: Element


class Joints(NamedTuple):
    """The joints that hang together, from the root."""

    root: str  # a link
    joints: list[Joint]  # in the description's order
    unplaced: frozenset[str]  # links with joints that do not lead to the root: their places are not known
    problems: list[str]  # what is left out or changed


def joints_of(robot: Element) -> Joints:
    """Return the joints of a <robot>. Raises BadDescription if it has no root, or too many joints."""
    elements = robot.findall("joint")
    if len(elements) > MAX_JOINTS:
        raise BadDescription(f"the robot’s description has more than {MAX_JOINTS} joints")
    return _Reader(robot, elements).result()


class _Reader:
    def __init__(self, robot: Element, elements: list[Element]) -> None:
        self._problems: list[str] = []
        self._above: dict[str, Joint] = {}  # by child
        self._torn: dict[str, str] = {}  # what is wrong with the joint above this link
        self._read(elements)
        self._below: defaultdict[str, list[str]] = defaultdict(list)
        for joint in self._above.values():
            self._below[joint.parent].append(joint.child)
        declared = (link.get("name", "") for link in robot.findall("link"))
        ends = (
            end.get("link", "")
            for joint in elements
            for tag in ("parent", "child")
            for end in joint.findall(tag)
        )
        self._links = dict.fromkeys([*filter(self._is_usable, declared), *filter(is_name, ends)])

    def result(self) -> Joints:
        branches = {link: self._carried(link) for link in self._links if link not in self._above}
        roots = [link for link in branches if link not in self._torn]
        if not roots:
            raise BadDescription(
                "the robot’s description has no root: no links, or joints in a cycle or without use"
            )
        root = max(roots, key=lambda link: len(branches[link]))  # the first of equal ones
        placed = branches.pop(root)
        for link, left in branches.items():
            why = self._torn.get(link, f"link {link!r} hangs on no joint")
            more = f", with {len(left) - 1} more" if len(left) > 1 else ""
            self._problems.append(f"{why}: {link} is left out{more}")
        circles = self._links.keys() - placed.union(*branches.values())
        if circles:
            self._problems.append(f"a cycle of joints, with {min(circles)} in it, is left out")
        joints = [joint for joint in self._above.values() if joint.child in placed]
        loose = {link for link, left in branches.items() if len(left) == 1 and link not in self._torn}
        return Joints(root, joints, frozenset(self._links.keys() - placed - loose), self._problems)

    def _read(self, elements: list[Element]) -> None:
        """Fill `_above` and `_torn`."""
        names = set[str]()
        for element in elements:
            try:
                joint = _joint(element, names, self._above)
            except Misfit as misfit:
                why = f"joint {element.get('name', '')[:80]!r}: {misfit}"
                child = element.find("child")
                link = child.get("link", "") if child is not None else ""
                if is_name(link) and link not in self._above:
                    self._torn[link] = why
                else:
                    self._problems.append(f"{why}: it is left out")
                continue
            names.add(joint.name)
            self._above[joint.child] = joint
            if element.get("type") in FREE:
                self._problems.append(f"joint {joint.name!r} is {element.get('type')}: it is taken as fixed")
        self._torn = {link: why for link, why in self._torn.items() if link not in self._above}

    def _is_usable(self, link: str) -> bool:
        if not is_name(link):
            self._problems.append(f"a link has the name {link[:80]!r}, with which it cannot be drawn")
        return is_name(link)

    def _carried(self, top: str) -> set[str]:
        """Return the link and all links that hang on it. Raises BadDescription if more than `DEEPEST` hang in a row."""
        carried, row = {top}, [top]
        for _ in range(DEEPEST + 1):
            row = [child for link in row for child in self._below.get(link, ())]
            if not row:
                return carried
            carried.update(row)
        raise BadDescription(f"the robot’s description has more than {DEEPEST} joints in a row")


def _joint(element: Element, names: set[str], above: dict[str, Joint]) -> Joint:
    """Return a joint that can be used with the others. Raises Misfit."""
    name, kind = name_of(element), element.get("type", "")
    parent, child = _end(element, "parent"), _end(element, "child")
    if name in names:
        raise Misfit("another joint has the same name")
    if child in above:
        raise Misfit(f"{child} hangs on joint {above[child].name!r} already")
    if kind not in (*MOVING, *FREE, "fixed"):
        raise Misfit(f"the type {kind[:80]!r} is not known")
    moves = kind in MOVING
    axis = axis_of(element) if moves else (1.0, 0.0, 0.0)  # exporters write 0 0 0 to fixed joints
    return Joint(name, kind if moves else "fixed", parent, child, *origin_of(element), axis, element)


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    if end is None:
        raise Misfit(f"it has no {tag}")
    return name_of(end, "link")
