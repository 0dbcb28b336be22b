"""The robot's joints, and its arm's posture: from the description, or from the last finished motion."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import NamedTuple

from robots.bridge.arm.tree import Tree
from robots.bridge.gate.arm.discs import AT_HOME, KNOWN_S, Disc, Posture, discs_along, is_home
from robots.bridge.gate.arm.sweep import Motion, swept
from robots.shared.configuration.bridge_config import ArmSource
from robots.shared.sentences import say
from robots.shared.urdf.document import BadDescription

log = logging.getLogger(__name__)

MAX_JOINTS = 4000  # joints whose positions are stored
MOST_LINKS = 80  # links of the arm whose positions are computed; a hand with five fingers has 40
MOST_DRAWN = 200  # joints whose positions are sent to pages
MOVED = 0.02  # rad or m: smaller changes are noise
END_M = 0.10  # fingers and the object that they hold reach this far beyond the last link's origin
HAND_M = 0.25  # assumed reach of a hand that is missing in the description
SHOULDER_M = 0.3  # a shoulder at an unknown place is assumed to be this far from the middle of the base


class _Model(NamedTuple):
    """The arm by one description. It is replaced as a whole, because other threads may use it."""

    tree: Tree
    own: list[str]  # links of the profile that the description has
    moved: dict[str, set[str]]  # all links that the arm moves, and the joints that move each link
    lacking: list[str]  # links of the profile that the description lacks

    def links(self, positions: Mapping[str, float]) -> list[str]:
        """Return the links whose joint positions are all known.

        Raises KeyError with the name of an unknown joint if that joint moves a link of the profile.
        """
        for link in self.own:
            for joint in self.moved[link] - positions.keys():
                raise KeyError(joint)
        return [link for link, joints in self.moved.items() if joints <= positions.keys()]


class ArmPosture:
    """Posture of one arm. Times are the bridge's monotonic clock, seconds.

    Joint positions and goals arrive on the threads of the ROS side; the gate's thread reads the posture.
    """

    def __init__(self, arm: ArmSource | None) -> None:
        """`arm` None: there is no arm, and only `joint` and `shown` may be called."""
        self.awaits_description = True  # whether the robot has one is not known yet
        self._has_arm = arm is not None
        self._arm = arm or ArmSource({}, [])
        self._model: _Model | None = None
        self._was: dict[str, float] | None = None  # the arm's joints when they moved last
        self._joints: dict[str, tuple[float, float]] = {}  # position and time of arrival
        self._drawn: frozenset[str] = frozenset()  # joints of the description that pages draw
        self._newest: tuple[str, str] | None = None  # goal id and motion of the newest goal, until it ends
        self._after: str | None = None  # the motion that succeeded last

    def describe(self, description: object) -> None:
        """Take the robot's description (URDF). If it is not usable, the profile's table of motions is used.

        Links of the profile that the description lacks are left out. A hand is then assumed at the last known
        link. Where a link is in the description, but its place is not known, the description is not usable.
        """
        model, drawn = None, frozenset[str]()
        if isinstance(description, str):
            try:
                tree = Tree(description)
                drawn = frozenset(sorted(tree.joints)[:MOST_DRAWN])
                model = self._modelled(tree) if self._has_arm else None
            except BadDescription as error:
                log.warning("%s: the arm's posture is known by its motions only", error)
        self._model, self._drawn = model, drawn

    def _modelled(self, tree: Tree) -> _Model:
        if unplaced := tree.unplaced.intersection(self._arm.links):
            text = "the place of {link} is not known from the robot’s description"
            raise BadDescription(say(text, link=min(unplaced)))
        own = [link for link in self._arm.links if link in tree]
        lacking = [link for link in self._arm.links if link not in tree]
        moved = tree.moved_by(self._arm.home)
        if not own or not moved:
            raise BadDescription(say("the robot’s description has no link of the arm"))
        if lacking:
            log.warning("the robot's description lacks %s: a hand there is guessed", ", ".join(lacking))
        base_first = [link for link in own if link not in moved]
        links = [*base_first, *moved[:MOST_LINKS], *(link for link in moved[MOST_LINKS:] if link in own)]
        return _Model(tree, own, {link: tree.moving([link]) for link in links}, lacking)

    def update(self, joints: Iterable[tuple[str, float]], now_s: float) -> None:
        """Take positions of some joints (rad or m). Ignore values that are not finite.

        Several nodes may each report some joints.
        """
        for name, position in joints:
            if math.isfinite(position):
                self._joints[name] = (position, now_s)
        if len(self._joints) > MAX_JOINTS:
            self._forget_oldest()

    def _forget_oldest(self) -> None:
        """Keep the arm's own joints, and the newest of the others."""
        model = self._model
        own = set(self._arm.home) | (set[str]().union(*model.moved.values()) if model else set())
        by_age = sorted(self._joints.items(), key=lambda item: (item[0] in own, item[1][1]))
        self._joints = dict(by_age[-MAX_JOINTS // 2 :])

    def joint(self, name: str, now_s: float) -> float | None:
        """Return the position (rad or m) of any joint; None if it was not reported lately."""
        position, arrival_s = self._joints.get(name, (0.0, -math.inf))
        return position if now_s - arrival_s <= KNOWN_S else None

    def shown(self, now_s: float) -> dict[str, float]:
        """Return the positions of joints of the description, for pages."""
        positions = self._positions(now_s)
        return {name: round(positions[name], 4) for name in self._drawn & positions.keys()}

    def posture(self, now_s: float) -> Posture:
        """Return the posture for the gate."""
        positions = self._positions(now_s)
        has_moved = self._has_moved(positions)
        home = is_home(positions, self._arm.home, self._arm.tolerance)
        if home:
            self._after = None
            return AT_HOME
        discs, ends = self._lies(positions)
        if self._model is None and self._after in self._arm.postures:
            discs = tuple(self._arm.postures[self._after])
        reach = self._reach(positions, self._end_m) if has_moved or discs is None else None
        return Posture(False, discs, ends, reach)

    def _has_moved(self, positions: Mapping[str, float]) -> bool:
        """Return whether the arm moved since the last call, or may have."""
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

    def goal_began(self, goal_id: str, motion: str) -> None:
        """Note the newest goal of the motion server."""
        self._newest, self._after = (goal_id, motion), None

    def goal_ended(self, goal_id: str, succeeded: bool) -> None:
        """Note the end of the newest goal. Ends of older goals are ignored: the newest may move the arm again."""
        newest, self._after = self._newest, None
        if newest and newest[0] == goal_id:
            self._newest = None
            self._after = newest[1] if succeeded else None

    def sweep(self, motion: Motion | None, now_s: float) -> tuple[Disc, ...]:
        """Return the space of a motion from the present posture; if this is unknown, the whole reach.

        The whole reach contains the space of every motion.
        """
        model, positions = self._model, self._positions(now_s)
        moving = set(self._arm.home) | (model.tree.moving(model.own) if model else set())
        if motion is not None and moving.isdisjoint(motion.joints):
            return ()
        if model is not None and motion is not None:
            tree = model.tree
            try:
                links = model.links(positions)
                ends = [number for number, is_end in enumerate(tree.ends(links)) if is_end]
                arm_m, hand_m = self._arm.radius_m, HAND_M if model.lacking else 0.0
                return swept(motion, positions, lambda at: tree.places(links, at), arm_m, ends, hand_m)
            except KeyError as joint:
                log.warning("no node reports %s: a motion is taken to sweep all within reach", joint)
        return (self._whole_reach(positions),)

    def problem(self, now_s: float) -> str:
        """Return in words why the arm's position is unknown although the robot reports joints; empty: it is known."""
        if self.awaits_description:
            return say("the robot’s description has not been read yet")
        arrivals_s = [self._joints.get(name, (0.0, -math.inf))[1] for name in self._arm.home]
        age_s = now_s - min(arrivals_s, default=now_s)
        if age_s <= KNOWN_S:
            return ""
        return (
            say("its joint states are {age:age} old", age=age_s)
            if math.isfinite(age_s)
            else say("no joint states have come yet")
        )

    def _whole_reach(self, positions: Mapping[str, float]) -> Disc:
        """Return a disc that contains every place of the arm, from above."""
        around = self._arm.radius_m + self._end_m + (SHOULDER_M if self._shoulder(positions) is None else 0.0)
        return self._reach(positions, around)

    def _reach(self, positions: Mapping[str, float], beyond_m: float) -> Disc:
        """Return a disc of the arm's reach and `beyond_m` around its shoulder; if that is unknown, around the base."""
        return *(self._shoulder(positions) or (0.0, 0.0)), self._arm.reach_m + beyond_m

    def _shoulder(self, positions: Mapping[str, float]) -> tuple[float, float] | None:
        """Return the place of the shoulder (m); None if it is unknown."""
        if (model := self._model) is not None:
            with suppress(KeyError):
                x, y, _ = map(float, model.tree.places(model.own[:1], positions)[0])
                return x, y
        return None

    def arm(self, now_s: float) -> tuple[Disc, ...] | None:
        """Return the discs that the arm covers, also at home; None if joints or description are missing."""
        discs, _ = self._lies(self._positions(now_s))
        return discs

    def _lies(self, positions: Mapping[str, float]) -> tuple[tuple[Disc, ...] | None, tuple[Disc, ...]]:
        """Return discs that the arm covers, and discs around its ends, where a camera may see more of it."""
        model, arm_m = self._model, self._arm.radius_m
        if model is None:
            return None, ()
        try:
            links = model.links(positions)
            places = model.tree.places(links, positions)
        except KeyError:  # a joint that no node reports
            return None, ()
        ends = [(float(x), float(y)) for x, y, _ in places[model.tree.ends(links)]]
        discs = discs_along(places, arm_m)
        if model.lacking:
            discs += tuple((*end, arm_m + HAND_M) for end in ends)
        return discs, tuple((*end, arm_m + self._end_m) for end in ends)

    @property
    def _end_m(self) -> float:
        return HAND_M if self._model and self._model.lacking else END_M

    def _positions(self, now_s: float) -> dict[str, float]:
        """Return the positions of all recently reported joints."""
        joints = dict(self._joints)  # another thread adds to it
        return {name: at for name, (at, arrival_s) in joints.items() if now_s - arrival_s <= KNOWN_S}
