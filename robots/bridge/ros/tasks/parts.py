"""The list of all parts that a robot may have."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robots.bridge.ros.tasks.head import HeadTopics
from robots.bridge.ros.tasks.limbs import LimbsTopics
from robots.bridge.ros.tasks.motions import MotionTopics
from robots.bridge.ros.tasks.navigation import NavigationTopics
from robots.bridge.ros.tasks.robot_part import Node, RobotPart
from robots.bridge.ros.tasks.speech import SpeechTopics

# Each returns its part, connected; None: the robot's profile does not have it.
PARTS: tuple[Callable[[Node], RobotPart | None], ...] = (
    HeadTopics.of,
    MotionTopics.of,
    SpeechTopics.of,
    NavigationTopics.of,
    LimbsTopics.of,
)


def parts_of(node: Node) -> Iterator[RobotPart]:
    """Make the parts that the robot's profile has."""
    for make in PARTS:
        part = make(node)
        if part is not None:
            yield part
