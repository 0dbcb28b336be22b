"""A robot's kinematic tree from its description (URDF): positions of its links for given joint positions.

Links whose places are not known are not in the tree. A joint's frame is its origin in the parent's frame, moved along
or about its axis (wiki.ros.org/urdf/XML/joint). Metres and radians.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.shared.sentences import say
from robots.shared.urdf.document import BadDescription, description_of
from robots.shared.urdf.joints import Joint, joints_of

Matrix = NDArray[np.float64]
Position = float | Matrix  # of a joint: one value, or an array of values over time


class _Joint(NamedTuple):
    parent: str
    name: str
    kind: str
    origin: Matrix  # (4, 4)
    axis: Matrix  # (3,), of length 1


class Tree:
    """Links and the joints between them."""

    def __init__(self, text: str) -> None:
        """Read `text` as far as it can be used. Raises BadDescription if nothing of it can."""
        found = joints_of(description_of(text).robot)
        self._above = {joint.child: _joint(joint) for joint in found.joints}
        self.unplaced = found.unplaced  # links of the description whose places are not known

    def moving(self, links: Sequence[str]) -> set[str]:
        """Return the joints that move any of `links`. Raises BadDescription if a link has no parent."""
        return {joint.name for link in links for joint in self._chain(link) if joint.kind != "fixed"}

    @property
    def joints(self) -> set[str]:
        """The joints that move something."""
        return {joint.name for joint in self._above.values() if joint.kind != "fixed"}

    def __contains__(self, link: object) -> bool:
        """Return whether this link has a parent."""
        return link in self._above

    def moved_by(self, joints: Collection[str]) -> list[str]:
        """Return the links that any of these joints moves, branch by branch, parent links first."""
        below: dict[str, list[str]] = {}
        for link, joint in self._above.items():
            below.setdefault(joint.parent, []).append(link)
        moved: list[str] = []
        left = [link for link, joint in self._above.items() if joint.name in joints]
        left.reverse()
        known = set[str]()
        while left:
            link = left.pop()
            if link not in known:
                known.add(link)
                moved.append(link)
                left += reversed(below.get(link, []))
        return moved

    def ends(self, links: Sequence[str]) -> list[bool]:
        """Return for each link whether it carries none of the others."""
        carrying = {self._above[link].parent for link in links}
        return [link not in carrying for link in links]

    def places(self, links: Sequence[str], positions: Mapping[str, Position]) -> Matrix:
        """Return the origins of the links in the root frame, (N, 3); with arrays over time (times, N, 3).

        Raises KeyError with the name of a joint without a position.
        """
        frames: dict[str, Matrix] = {}
        origins = [self._frame(link, positions, frames)[..., :3, 3] for link in links]
        return np.stack(np.broadcast_arrays(*origins), axis=-2)

    def _frame(self, link: str, positions: Mapping[str, Position], frames: dict[str, Matrix]) -> Matrix:
        """Return the link's frame. `frames` caches the frame behind each joint, which several links use."""
        frame = np.eye(4)
        for joint in reversed(self._chain(link)):
            if joint.name not in frames:
                position = 0.0 if joint.kind == "fixed" else positions[joint.name]
                frames[joint.name] = frame @ joint.origin @ _motion(joint, position)
            frame = frames[joint.name]
        return frame

    def _chain(self, link: str) -> list[_Joint]:
        """Return the joints from a link up to the root."""
        chain: list[_Joint] = []
        while joint := self._above.get(link):
            chain.append(joint)
            link = joint.parent
        if not chain:
            raise BadDescription(
                say("the robot’s description has no link {link} with a parent", link=repr(link))
            )
        return chain


def _joint(joint: Joint) -> _Joint:
    origin = np.eye(4)
    origin[:3, 3] = joint.xyz
    origin[:3, :3] = _rotation(*joint.rpy)
    return _Joint(joint.parent, joint.name, joint.kind, origin, np.array(joint.axis))


def _rotation(roll: float, pitch: float, yaw: float) -> Matrix:
    """Rotate about the fixed axes x, then y, then z."""
    return _about((0.0, 0.0, 1.0), yaw) @ _about((0.0, 1.0, 0.0), pitch) @ _about((1.0, 0.0, 0.0), roll)


def _about(axis: Sequence[float] | Matrix, angle: Position) -> Matrix:
    """Rotate by Rodrigues' formula: R = I + sin(angle) K + (1 - cos(angle)) K^2, K v = axis x v."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin, cos = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    turned: Matrix = np.eye(3) + sin * cross + (1.0 - cos) * (cross @ cross)
    return turned


def _motion(joint: _Joint, position: Position) -> Matrix:
    moved = np.broadcast_to(np.eye(4), (*np.shape(position), 4, 4)).copy()
    if joint.kind == "prismatic":
        moved[..., :3, 3] = np.multiply.outer(position, joint.axis)
    elif joint.kind != "fixed":
        moved[..., :3, :3] = _about(joint.axis, position)
    return moved
