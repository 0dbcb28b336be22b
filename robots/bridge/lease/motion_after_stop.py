"""A robot that moves although it is stopped: somebody else commands it, pushes it, or it rolls.

A stop sends zeros on the drive topic and cancels goals. A node that publishes to the base's controller itself, or that
ignores cancels, is not stopped by that: only the red button stops the robot, and people must know it at once. Base by
odometry, other parts by joint states. Time is an argument.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future

from robots.bridge.audit.records import Records
from robots.bridge.gate.motion.braking import braking_time
from robots.shared.configuration.bridge_config import BridgeConfig, Topics
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.sentences import Sentence, joined, say
from robots.shared.wire import MovesAlthoughStopped, Part, StopState

SPARE_S = 0.3  # beyond the braking time of the robot
MOVES_S = 0.5  # of motion, with pauses: less may be a bump, or noise
PAUSE_SHARE = 0.25  # how much of a pause counts against the motion before it
STANDS_S = 2.0  # at standstill, until the motion is over: a navigation that drives on makes pauses
# Also this way of the base, in this time: jerks between zeros, or a slow roll, are nearly always too short to be seen.
CREEPS_S, CREEPS_M, CREEPS_RAD = 15.0, 0.08, 0.15
COMPARED_S = 0.5  # between two positions of a joint, or two places of the base
JOINT_MOVES = 0.02  # rad, in that time; a torso or gripper also moves if it goes `LIFT_MOVES` (m)
LIFT_MOVES = 0.005
_LIFTS: frozenset[Part] = frozenset({"torso", "gripper"})

# Number of the odometry's frame, which changes when the odometry begins again; and the base's pose in it.
Place = tuple[int, Pose]


def braking_s(profile: GateProfile, velocity: Velocity | None, latency_s: float) -> float:
    """Return the time (s) in which a robot with this velocity must stand after a stop; None: at its top speed."""
    limits = profile.limits
    if velocity is None:
        top_mps = math.hypot(max(limits.forward_mps, limits.reverse_mps), limits.lateral_mps)
        velocity = Velocity(top_mps, 0.0, limits.turn_radps)
    return latency_s + braking_time(velocity, profile) + SPARE_S


def joints_of(topics: Topics) -> dict[Part, frozenset[str]]:
    """Return the names of the joints of each part of the robot that joint states show."""
    if topics.joint_states is None:
        return {}
    parts: dict[Part, frozenset[str]] = {
        name: frozenset(source.joints) for name, source in topics.limbs.items()
    }
    if topics.head:
        parts["head"] = frozenset({topics.head.pan_joint, topics.head.tilt_joint})
    if topics.arm:
        parts["arm"] = frozenset(topics.arm.home) - frozenset[str]().union(*parts.values())
    return parts


class _Moving:
    """Whether one part moves, without flicker."""

    def __init__(self) -> None:
        self.moves = False
        self._moved_s = 0.0  # less a share of the pauses
        self._observed_s: float | None = None
        self._stood_since_s: float | None = None

    def observe(self, moves: bool | None, now_s: float) -> None:
        """Take whether the part moves now. None: nobody knows, and nothing changes."""
        step_s = 0.0 if self._observed_s is None else now_s - self._observed_s
        self._observed_s = None if moves is None else now_s
        if moves is None:
            return
        if moves:
            self._moved_s, self._stood_since_s = self._moved_s + step_s, None
        else:
            self._moved_s = max(self._moved_s - PAUSE_SHARE * step_s, 0.0)
            self._stood_since_s = now_s if self._stood_since_s is None else self._stood_since_s
        if self._moved_s >= MOVES_S:
            self.moves = True
        if self._stood_since_s is not None and now_s - self._stood_since_s >= STANDS_S:
            self.moves, self._moved_s = False, 0.0


class _Creeping:
    """Whether the base is elsewhere than some seconds ago, however slowly or seldom it moves."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin again at the next place."""
        self.moves = False
        self._frame = 0
        self._places: deque[tuple[float, Pose]] = deque()

    def observe(self, place: Place | None, now_s: float) -> None:
        """Take the base's place by odometry; None: nobody knows, and nothing changes."""
        if place is None or place[0] != self._frame:
            self._places.clear()
        if place is None or (self._places and now_s - self._places[-1][0] < COMPARED_S):
            return
        self._frame, pose = place
        self._places.append((now_s, pose))
        while now_s - self._places[0][0] > CREEPS_S:
            self._places.popleft()
        self.moves = any(
            math.dist(pose[:2], before[:2]) > CREEPS_M
            or abs(math.remainder(pose.yaw - before.yaw, math.tau)) > CREEPS_RAD
            for _, before in self._places
        )


class _Joints:
    """Whether the joints of one part move, by their positions some tenths of a second apart."""

    def __init__(self, part: Part, names: Iterable[str]) -> None:
        self._names = sorted(names)
        self._moves_from = LIFT_MOVES if part in _LIFTS else JOINT_MOVES
        self._before: dict[str, float] = {}
        self._compared_s = -math.inf
        self._moves: bool | None = None

    def moves(self, joint: Callable[[str], float | None], now_s: float) -> bool | None:
        """Return whether a joint has moved lately; None: no joint state came."""
        if now_s - self._compared_s >= COMPARED_S:
            self._compared_s = now_s
            places = {name: joint(name) for name in self._names}
            now = {name: place for name, place in places.items() if place is not None}
            both = now.keys() & self._before.keys()
            gone = (abs(math.remainder(now[name] - self._before[name], math.tau)) for name in both)
            self._moves = any(way > self._moves_from for way in gone) if both else None
            self._before = now
        return self._moves


class MotionAfterStop:
    """Watches one robot while it is stopped, whoever controls it, and records each event once."""

    def __init__(self, config: BridgeConfig, records: Records, joint: Callable[[str], float | None]) -> None:
        """`joint`: the position (rad or m) of a joint; None if it was not reported lately."""
        self._profile = config.gate
        self._records = records
        self._joint = joint
        self._joints = {part: _Joints(part, names) for part, names in joints_of(config.topics).items()}
        self._parts: dict[Part, _Moving] = {}
        self._creeping = _Creeping()
        self._braked_s: float | None = None  # from then on, it must stand; None: it is not stopped
        self._began_s: float | None = None  # when it was noticed that the robot moves
        # of this event so far: the parts that moved, the highest speeds, the known publishers
        self._seen: set[Part] = set()
        self._top = STILL
        self._publishers: dict[str, list[str]] = {}
        self._velocity: Velocity | None = None  # None: odometry is silent
        self._record: Future[int] | None = None

    def close(self, now_s: float) -> None:
        """End: the bridge ends. The next one notices again whether the robot moves."""
        self._end("bridge_ended", now_s)

    def tick(
        self,
        stop: StopState,
        still: bool | None,
        place: Place | None,
        velocity: Velocity | None,
        latency_s: float,
        publishers: Mapping[str, list[str]],
        now_s: float,
    ) -> None:
        """Judge the robot while it is stopped. `still`, `place`, `velocity`: by odometry; None: it is silent.

        `latency_s`: of the robot. `publishers`: nodes that publish velocities for its base, by topic.
        """
        if stop.state == "clear":
            self._end("cleared", now_s)
            self._braked_s = None
            return
        if self._braked_s is None:  # the stop was pressed, or this bridge started, a moment ago
            self._parts = {part: _Moving() for part in ("base", *self._joints)}
            self._creeping.forget()
            self._braked_s = now_s + braking_s(self._profile, velocity, latency_s)
        self._velocity = velocity
        if now_s < self._braked_s:
            return
        base = self._parts["base"]
        moved = base.moves
        base.observe(None if still is None else not still, now_s)
        if moved and not base.moves:
            self._creeping.forget()
        self._creeping.observe(place, now_s)
        for part, joints in self._joints.items():
            self._parts[part].observe(joints.moves(self._joint, now_s), now_s)
        if not (moving := self._moving):
            self._end("stood", now_s)
            return
        self._seen.update(moving)
        self._publishers |= publishers
        if velocity is not None:
            self._top = Velocity(*(max(abs(now), top) for now, top in zip(velocity, self._top, strict=True)))
        if self._began_s is None:
            self._began_s = now_s
            facts = {"number": stop.number, **self._facts()}
            self._record = self._records.own("stop.moves", facts, now_s)

    def view(self, publishers: Mapping[str, list[str]], now_s: float) -> MovesAlthoughStopped | None:
        """Return what pages show; None: the robot is not stopped, or obeys."""
        if self._began_s is None:
            return None
        velocity, parts = self._velocity, self._moving
        speed = None if velocity is None else round(math.hypot(velocity.vx, velocity.vy), 2)
        turn = None if velocity is None else round(velocity.w, 2)
        return MovesAlthoughStopped(
            since_s=round(now_s - self._began_s, 1),
            parts=parts,
            speed_mps=speed,
            turn_radps=turn,
            publishers=dict(publishers),
            text=_words(parts, speed, turn, publishers),
        )

    @property
    def headline(self) -> tuple[object, ...]:
        """Return the part of the view whose changes are reported at once."""
        return self._began_s, tuple(self._moving), self._velocity is None

    @property
    def _moving(self) -> list[Part]:
        creeping = self._creeping.moves
        return [name for name, part in self._parts.items() if part.moves or (creeping and name == "base")]

    def _end(self, outcome: str, now_s: float) -> None:
        record, began_s = self._record, self._began_s
        self._record = self._began_s = None
        if record is None or began_s is None:
            return
        facts = {"duration_s": round(now_s - began_s, 1), **self._facts()}
        self._seen, self._top, self._publishers = set(), STILL, {}
        self._records.own_outcome(record, "stop.moves", outcome, facts, now_s)

    def _facts(self) -> dict[str, str | float | None]:
        return {
            "parts": ", ".join(part for part in self._parts if part in self._seen),
            "top_mps": round(math.hypot(self._top.vx, self._top.vy), 2),
            "top_radps": round(abs(self._top.w), 2),
            "publishers": _named(self._publishers),
        }


PARTS: Mapping[Part, Sentence] = {
    "arm": say("Its arm moves."),
    "torso": say("Its torso moves."),
    "head": say("Its head moves."),
    "gripper": say("Its gripper moves."),
}


def _words(
    parts: list[Part], speed: float | None, turn: float | None, publishers: Mapping[str, list[str]]
) -> Sentence:
    """Return for people: the motion, and its possible cause."""
    told = [PARTS[part] for part in parts if part != "base"]
    if "base" not in parts:
        return joined(" ", [*told, say("Other software moves it, or somebody pushes it.")])
    told.insert(0, _way(speed, turn))
    if publishers:
        told.append(say("Velocities for its base come from {nodes}.", nodes=_named(publishers)))
    else:
        told.append(say("No other node is known that sends velocities: somebody pushes it, or it rolls."))
    return joined(" ", told)


def _way(speed: float | None, turn: float | None) -> Sentence:
    """Return how the base moves."""
    if speed is None or turn is None:
        return say("Its odometry is silent now: nobody knows whether it still moves.")
    if speed >= 0.01 and turn:
        return say("It drives at {speed} m/s and turns at {turn} rad/s.", speed=speed, turn=abs(turn))
    if speed >= 0.01:
        return say("It drives at {speed} m/s.", speed=speed)
    return say("It turns at {turn} rad/s.", turn=abs(turn)) if turn else say("It moved a moment ago.")


def _named(publishers: Mapping[str, list[str]]) -> str:
    return "; ".join(f"{', '.join(nodes)} on {topic}" for topic, nodes in publishers.items())
