"""The joints of a description as a tree, from its root.

A joint that cannot be used is left out with all that hangs on it: the places of those links are not known. Links that
hang on no joint, such as a second robot, are left out too. RViz refuses some of these descriptions as a whole.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple
from xml.etree.ElementTree import Element

from robots.shared.sentences import Sentence, say
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
    problems: list[Sentence]  # what is left out or changed


def joints_of(robot: Element) -> Joints:
    """Return the joints of a <robot>. Raises BadDescription if it has no root, or too many joints."""
    elements = robot.findall("joint")
    if len(elements) > MAX_JOINTS:
        raise BadDescription(say("the robot’s description has more than {most} joints", most=MAX_JOINTS))
    return _Reader(robot, elements).result()


class _Reader:
    def __init__(self, robot: Element, elements: list[Element]) -> None:
        self._problems: list[Sentence] = []
        self._above: dict[str, Joint] = {}  # by child
        self._torn: dict[str, Sentence] = {}  # what is wrong with the joint above this link
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
                say("the robot’s description has no root: no links, or joints in a cycle or without use")
            )
        root = max(roots, key=lambda link: len(branches[link]))  # the first of equal ones
        placed = branches.pop(root)
        for link, left in branches.items():
            why = self._torn.get(link) or say("link {link} hangs on no joint", link=repr(link))
            figures, more = {"why": why, "link": link}, len(left) - 1
            self._problems.append(
                say("{why}: {link} is left out, with {more} more", **figures, more=more)
                if more
                else say("{why}: {link} is left out", **figures)
            )
        circles = self._links.keys() - placed.union(*branches.values())
        if circles:
            self._problems.append(say("a cycle of joints, with {link} in it, is left out", link=min(circles)))
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
                why = say("joint {name}: {misfit}", name=repr(element.get("name", "")[:80]), misfit=misfit)
                child = element.find("child")
                link = child.get("link", "") if child is not None else ""
                if is_name(link) and link not in self._above:
                    self._torn[link] = why
                else:
                    self._problems.append(say("{why}: it is left out", why=why))
                continue
            names.add(joint.name)
            self._above[joint.child] = joint
            if element.get("type") in FREE:
                text = "joint {name} is {kind}: it is taken as fixed"
                self._problems.append(say(text, name=repr(joint.name), kind=element.get("type")))
        self._torn = {link: why for link, why in self._torn.items() if link not in self._above}

    def _is_usable(self, link: str) -> bool:
        if not is_name(link):
            self._problems.append(
                say("a link has the name {name}, with which it cannot be drawn", name=repr(link[:80]))
            )
        return is_name(link)

    def _carried(self, top: str) -> set[str]:
        """Return the link and all links that hang on it. Raises BadDescription if more than `DEEPEST` hang in a row."""
        carried, row = {top}, [top]
        for _ in range(DEEPEST + 1):
            row = [child for link in row for child in self._below.get(link, ())]
            if not row:
                return carried
            carried.update(row)
        raise BadDescription(
            say("the robot’s description has more than {most} joints in a row", most=DEEPEST)
        )


def _joint(element: Element, names: set[str], above: dict[str, Joint]) -> Joint:
    """Return a joint that can be used with the others. Raises Misfit."""
    name, kind = name_of(element), element.get("type", "")
    parent, child = _end(element, "parent"), _end(element, "child")
    if name in names:
        raise Misfit(say("another joint has the same name"))
    if child in above:
        raise Misfit(say("{link} hangs on joint {name} already", link=child, name=repr(above[child].name)))
    if kind not in (*MOVING, *FREE, "fixed"):
        raise Misfit(say("the type {kind} is not known", kind=repr(kind[:80])))
    moves = kind in MOVING
    axis = axis_of(element) if moves else (1.0, 0.0, 0.0)  # exporters write 0 0 0 to fixed joints
    return Joint(name, kind if moves else "fixed", parent, child, *origin_of(element), axis, element)


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    if end is None:
        raise Misfit(say("it has no {part}", part=tag))
    return name_of(end, "link")
