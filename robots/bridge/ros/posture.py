"""Where the arm is: from joint states by the robot's description, or by the motion that it finished last.

Joint states come fifty times a second on a thread of rospy's; ten times a second the posture is told.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import rospy
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState

from robots.bridge.config import ArmSource, Topic
from robots.bridge.gate.posture import AT_HOME, KNOWN_S, UNKNOWN, Disc, Posture, discs_along, is_home
from robots.bridge.gate.sweep import Motion, swept
from robots.bridge.ros.bounds.sizes import expect
from robots.bridge.ros.bounds.texts import NAME, cut
from robots.bridge.ros.types import message_class
from robots.bridge.urdf import BadDescription, Tree

log = logging.getLogger(__name__)

EVERY_S = 0.1
MOST_JOINTS = 4000  # of which positions are kept

Take = Callable[[Posture, float], None]


class PostureTopics:
    """The topics that tell of one arm. `take` is called on a thread of rospy's with the posture and its arrival."""

    def __init__(self, arm: ArmSource, take: Take) -> None:
        self._arm = arm
        self._take = take
        self._tree: Tree | None = None
        self._joints: dict[str, tuple[float, float]] = {}  # position and arrival
        self._told_s = float("-inf")
        self._newest: tuple[str, str] | None = None  # goal id and motion of the newest goal, until it ends
        self._after: str | None = None  # the motion that ended last, as it should

    def describe(self, description: object) -> None:
        """Take the robot's description; without a usable one the table of motions counts."""
        self._tree = None
        if isinstance(description, str):
            try:
                tree = Tree(description)
                tree.moving(self._arm.links)
                self._tree = tree
            except BadDescription as error:
                log.warning("%s: the arm's place is told by its motions only", error)

    def subscribe(self, joint_states: Topic, motions: Topic | None) -> list[rospy.Subscriber]:
        """Listen."""
        expect(joint_states.name, "sensor_msgs/JointState")
        subscribers = [rospy.Subscriber(joint_states.name, rospy.AnyMsg, self._hear, queue_size=1)]
        if motions and self._arm.postures:
            kind = motions.type.removesuffix("Action")
            for part, hear in (("goal", self._begun), ("result", self._ended)):
                topic, type_ = f"{motions.name}/{part}", f"{kind}Action{part.capitalize()}"
                subscribers.append(rospy.Subscriber(topic, message_class(type_), hear, queue_size=10))
        return subscribers

    def sweep(self, motion: Motion | None, now_s: float) -> tuple[Disc, ...]:
        """The space that the arm sweeps in a motion from where it is; all within its reach if that is not known."""
        tree, positions = self._tree, self._positions(now_s)
        moving = set(self._arm.home) | (tree.moving(self._arm.links) if tree else set())
        if motion is not None and moving.isdisjoint(motion.joints):
            return ()
        shoulder = (0.0, 0.0)
        if tree is not None:
            try:
                if motion is not None:
                    links = self._arm.links
                    return swept(motion, positions, lambda at: tree.places(links, at), self._arm.radius_m)
                x, y, _ = tree.places(self._arm.links[:1], positions)[0]
                shoulder = (float(x), float(y))
            except KeyError as joint:
                log.warning("nobody tells where %s is: a motion is taken to sweep all within reach", joint)
        return ((*shoulder, self._arm.reach_m),)

    def arm(self, now_s: float) -> tuple[Disc, ...] | None:
        """The discs that the arm covers, at home too; None if joints and description do not tell."""
        if self._tree is None:
            return None
        try:
            return self._discs(self._tree, self._positions(now_s))
        except KeyError:  # a joint that nobody tells of
            return None

    def _discs(self, tree: Tree, positions: Mapping[str, float]) -> tuple[Disc, ...]:
        return discs_along(tree.places(self._arm.links, positions), self._arm.radius_m)

    def _positions(self, now_s: float) -> dict[str, float]:
        """Of all joints that were told of lately."""
        told = dict(self._joints)  # another thread adds to it
        return {name: at for name, (at, arrival_s) in told.items() if now_s - arrival_s <= KNOWN_S}

    # --- on rospy's threads ------------------------------------------------------------------------

    def _hear(self, raw: Any) -> None:
        """Several nodes may tell of some joints each. A position that is no number is not told."""
        arrival_s = time.monotonic()
        message = JointState().deserialize(raw._buff)
        for name, position in zip(message.name, message.position, strict=False):
            if math.isfinite(position):
                self._joints[cut(name, NAME)] = (position, arrival_s)
        if len(self._joints) > MOST_JOINTS:
            self._forget_late(arrival_s)
        if arrival_s - self._told_s >= EVERY_S:
            self._told_s = arrival_s
            self._take(self._posture(arrival_s), arrival_s)

    def _forget_late(self, now_s: float) -> None:
        """Too many names were told: kept are the arm's own joints, and of the others those that were told last."""
        own = set(self._arm.home) | (self._tree.moving(self._arm.links) if self._tree else set())
        told = sorted(self._joints.items(), key=lambda item: (item[0] in own, item[1][1]))
        self._joints = dict(told[-MOST_JOINTS // 2 :])

    def _posture(self, now_s: float) -> Posture:
        positions = self._positions(now_s)
        home = is_home(positions, self._arm.home, self._arm.tolerance)
        if home:
            self._after = None
            return AT_HOME
        if self._tree is not None:
            discs = self.arm(now_s)
            return UNKNOWN if discs is None else Posture(False, discs)
        if self._after in self._arm.postures:
            return Posture(False, tuple(self._arm.postures[self._after]))
        return UNKNOWN

    def _begun(self, goal: Any) -> None:
        self._newest = (cut(goal.goal_id.id, NAME), cut(goal.goal.motion_name, NAME))
        self._after = None

    def _ended(self, result: Any) -> None:
        """Of the newest goal only: what another one leaves the arm in, the newest may change."""
        newest, self._after = self._newest, None
        if newest and newest[0] == result.status.goal_id.id:
            self._newest = None
            self._after = newest[1] if result.status.status == GoalStatus.SUCCEEDED else None
