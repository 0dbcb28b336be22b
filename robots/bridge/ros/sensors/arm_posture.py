"""Where the arm is: from joint states by the robot's description, or by the motion that it finished last.

Joint states come fifty times a second; ten times a second a thread of rospy's reads them, and the posture is told.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import rospy
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState

from robots.bridge.config import ArmSource, Topic
from robots.bridge.gate.geometry.arm_discs import AT_HOME, KNOWN_S, Disc, Posture, discs_along, is_home
from robots.bridge.gate.geometry.arm_sweep import Motion, swept
from robots.bridge.ros.bounds.listening import pause
from robots.bridge.ros.bounds.sizes import expect
from robots.bridge.ros.bounds.texts import NAME, cut
from robots.bridge.ros.message_types.classes import message_class
from robots.bridge.tasks.urdf import BadDescription, Tree

log = logging.getLogger(__name__)

EVERY_S = 0.1
JOINTS_WAIT = 10  # messages of one publisher: each may tell of other joints
MAX_JOINTS = 4000  # of which positions are kept
MOST_LINKS = 80  # of the arm's that are looked at; a hand with five fingers has 40
MOVED = 0.02  # rad or m: less is noise
END_M = 0.10  # how far what a camera sees may be from the last link's origin: fingers, and what they hold
HAND_M = 0.25  # the reach of a hand that the description leaves out

Take = Callable[[Posture, float], None]


class PostureTopics:
    """The topics that tell of one arm. `take` is called on a thread of rospy's with the posture and its arrival."""

    def __init__(self, arm: ArmSource, take: Take) -> None:
        self._arm = arm
        self._take = take
        self._tree: Tree | None = None
        self._own: list[str] = []  # of the profile's links those that the description has
        self._moved: dict[str, set[str]] = {}  # all links that the arm moves, and the joints that each needs
        self._lacking: list[str] = []  # of the profile's links
        self._was: dict[str, float] | None = None  # where the arm's joints were when they moved last
        self._joints: dict[str, tuple[float, float]] = {}  # position and arrival
        self._told_s = float("-inf")
        self._newest: tuple[str, str] | None = None  # goal id and motion of the newest goal, until it ends
        self._after: str | None = None  # the motion that ended last, as it should

    def describe(self, description: object) -> None:
        """Take the robot's description; without a usable one the table of motions counts.

        A link that it lacks is left out, and what the hand reaches is reckoned from the last one.
        """
        self._tree = None
        if isinstance(description, str):
            try:
                self._take_tree(Tree(description))
            except BadDescription as error:
                log.warning("%s: the arm's place is told by its motions only", error)

    def _take_tree(self, tree: Tree) -> None:
        own = [link for link in self._arm.links if link in tree]
        self._lacking = [link for link in self._arm.links if link not in tree]
        moved = tree.moved_by(self._arm.home)
        if not own or not moved:
            raise BadDescription("the robot’s description has no link of the arm")
        if self._lacking:
            log.warning("the robot's description lacks %s: a hand there is guessed", ", ".join(self._lacking))
        base_first = [link for link in own if link not in moved]
        links = [*base_first, *moved[:MOST_LINKS], *(link for link in moved[MOST_LINKS:] if link in own)]
        self._moved = {link: tree.moving([link]) for link in links}
        self._own, self._tree = own, tree

    def subscribe(self, joint_states: Topic, motions: Topic | None) -> list[rospy.Subscriber]:
        """Listen."""
        expect(joint_states.name, "sensor_msgs/JointState")
        pause(joint_states.name, lambda: EVERY_S)
        subscribers = [rospy.Subscriber(joint_states.name, rospy.AnyMsg, self._hear, queue_size=JOINTS_WAIT)]
        if motions and self._arm.postures:
            kind = motions.type.removesuffix("Action")
            for part, hear in (("goal", self._begun), ("result", self._ended)):
                topic, type_ = f"{motions.name}/{part}", f"{kind}Action{part.capitalize()}"
                subscribers.append(rospy.Subscriber(topic, message_class(type_), hear, queue_size=10))
        return subscribers

    def sweep(self, motion: Motion | None, now_s: float) -> tuple[Disc, ...]:
        """The space that the arm sweeps in a motion from where it is; all within its reach if that is not known."""
        tree, positions = self._tree, self._positions(now_s)
        moving = set(self._arm.home) | (tree.moving(self._own) if tree else set())
        if motion is not None and moving.isdisjoint(motion.joints):
            return ()
        if tree is not None and motion is not None:
            try:
                links = self._links(positions)
                ends = [number for number, is_end in enumerate(tree.ends(links)) if is_end]
                arm_m, hand_m = self._arm.radius_m, HAND_M if self._lacking else 0.0
                return swept(motion, positions, lambda at: tree.places(links, at), arm_m, ends, hand_m)
            except KeyError as joint:
                log.warning("nobody tells where %s is: a motion is taken to sweep all within reach", joint)
        return (self._reach(positions),)

    def _reach(self, positions: Mapping[str, float], beyond_m: float = 0.0) -> Disc:
        """All that the arm may touch, and so far beyond; about the base's middle where nobody tells its shoulder's."""
        x = y = 0.0
        if self._tree is not None:
            with suppress(KeyError):
                x, y, _ = map(float, self._tree.places(self._own[:1], positions)[0])
        return x, y, self._arm.reach_m + beyond_m

    def arm(self, now_s: float) -> tuple[Disc, ...] | None:
        """The discs that the arm covers, at home too; None if joints and description do not tell."""
        discs, _ = self._lies(self._positions(now_s))
        return discs

    def _lies(self, positions: Mapping[str, float]) -> tuple[tuple[Disc, ...] | None, tuple[Disc, ...]]:
        """The discs that the arm covers, and those about its ends where a camera may see more of it."""
        tree, arm_m = self._tree, self._arm.radius_m
        if tree is None:
            return None, ()
        try:
            links = self._links(positions)
            places = tree.places(links, positions)
        except KeyError:  # a joint that nobody tells of
            return None, ()
        ends = [(float(x), float(y)) for x, y, _ in places[tree.ends(links)]]
        discs = discs_along(places, arm_m)
        if self._lacking:
            discs += tuple((*end, arm_m + HAND_M) for end in ends)
        return discs, tuple((*end, arm_m + self._end_m) for end in ends)

    @property
    def _end_m(self) -> float:
        return HAND_M if self._lacking else END_M

    def _links(self, positions: Mapping[str, float]) -> list[str]:
        """The arm's links as far as joints are told; of those in the profile all. KeyError names a joint that lacks."""
        for link in self._own:
            for joint in self._moved[link] - positions.keys():
                raise KeyError(joint)
        return [link for link, joints in self._moved.items() if joints <= positions.keys()]

    def _positions(self, now_s: float) -> dict[str, float]:
        """Return the positions of all recently reported joints."""
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
        if len(self._joints) > MAX_JOINTS:
            self._forget_late(arrival_s)
        if arrival_s - self._told_s >= EVERY_S:
            self._told_s = arrival_s
            self._take(self._posture(arrival_s), arrival_s)

    def _forget_late(self, now_s: float) -> None:
        """Too many names were told: kept are the arm's own joints, and of the others those that were told last."""
        own = set(self._arm.home) | (set[str]().union(*self._moved.values()) if self._tree else set())
        told = sorted(self._joints.items(), key=lambda item: (item[0] in own, item[1][1]))
        self._joints = dict(told[-MAX_JOINTS // 2 :])

    def _posture(self, now_s: float) -> Posture:
        positions = self._positions(now_s)
        has_moved = self._has_moved(positions)
        home = is_home(positions, self._arm.home, self._arm.tolerance)
        if home:
            self._after = None
            return AT_HOME
        discs, ends = self._lies(positions)
        if self._tree is None and self._after in self._arm.postures:
            discs = tuple(self._arm.postures[self._after])
        reach = self._reach(positions, self._end_m) if has_moved or discs is None else None
        return Posture(False, discs, ends, reach)

    def _has_moved(self, positions: Mapping[str, float]) -> bool:
        """Whether the arm moved since it was asked last, or may have."""
        now = {joint: positions[joint] for joint in self._arm.home if joint in positions}
        before = self._was
        rests = (
            before is not None
            and before.keys() == now.keys()
            and all(abs(at - before[joint]) <= MOVED for joint, at in now.items())
        )
        if not rests:
            self._was = now
        return not rests

    def _begun(self, goal: Any) -> None:
        self._newest = (cut(goal.goal_id.id, NAME), cut(goal.goal.motion_name, NAME))
        self._after = None

    def _ended(self, result: Any) -> None:
        """Handle the end of the newest goal. Ends of older goals are ignored: the newest may move the arm again."""
        newest, self._after = self._newest, None
        if newest and newest[0] == result.status.goal_id.id:
            self._newest = None
            self._after = newest[1] if result.status.status == GoalStatus.SUCCEEDED else None
