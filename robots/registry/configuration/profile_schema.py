"""The structured parts of a profile or robot: from JSON to values, with checks.

People edit these parts as JSON in the admin, so every error names its place: "scans[0].pose[1]: Expected
a number, got text". This module does not use the database.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from robots.shared.configuration.bridge_config import (
    GRIPPER_COMMAND,
    GRIPPER_COMMAND_2,
    TOPIC_TYPES,
    TRAJECTORY,
    TRAJECTORY_2,
    ArmSource,
    CameraSource,
    DepthSource,
    HeadSource,
    LimbSource,
    NavigationSource,
    ScanSource,
    SonarSource,
    Topic,
    Topics,
)
from robots.shared.configuration.denylist import FULL_NAME
from robots.shared.configuration.gate_profile import Parameters
from robots.shared.configuration.input_filters import SMOOTHING, STEPS, StickStep
from robots.shared.configuration.robot_ros import RosVersion
from robots.shared.messages.type_names import in_ros2
from robots.shared.misfits import misfit_of
from robots.shared.sentences import Sentence, joined, say
from robots.shared.wire import MOST_CAMERAS

T = TypeVar("T", bound=Struct)
V = TypeVar("V")

_PICTURES = ("sensor_msgs/CompressedImage", "sensor_msgs/Image")
CAMERA_TYPES = {1: _PICTURES, 2: tuple(map(in_ros2, _PICTURES))}
NAVIGATION_TYPES = {1: ("move_base_msgs/MoveBaseAction",), 2: ("nav2_msgs/action/NavigateToPose",)}
LIMB_TYPES = {1: (TRAJECTORY,), 2: (TRAJECTORY_2,)}
COMMANDS = {1: GRIPPER_COMMAND, 2: GRIPPER_COMMAND_2}
WITH_OTHERS = ("drive", "speech")  # the drive topic's others are its other types, which nobody enters
CAMERA_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
LANGUAGE = re.compile(r"(?=.{2,35}$)[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*")  # BCP 47


class Footprint(Struct, frozen=True):
    """Either a disc around the base frame's origin, or a convex outline around the origin (metres)."""

    radius_m: float | None = None
    outline: list[tuple[float, float]] | None = None


class Tightening(Struct, frozen=True):
    """Lower limits of one robot; None keeps the profile's limit."""

    forward_mps: float | None = None
    reverse_mps: float | None = None
    lateral_mps: float | None = None
    turn_radps: float | None = None
    linear_mps2: float | None = None
    angular_radps2: float | None = None
    blind_mps: float | None = None


class Overrides(Struct, frozen=True):
    """Differences of one robot from its profile.

    Each key of `topics` replaces the same key of the profile (null: this robot does not have it). `limits` and
    `gate` may only be stricter than in the profile.
    """

    topics: dict[str, Any] = {}
    limits: Tightening = Tightening()
    gate: dict[str, float] = {}


class StickChain(Struct, frozen=True):
    """Filters of stick positions before the gate, in order."""

    stick: tuple[StickStep, ...]


# msgspec analyses a type at its first use. If a second thread uses the type at the same moment, the process crashes.
# So each type is used here, before there are threads.
for _kind in (Footprint, Overrides, StickChain, Topics, Parameters):
    msgspec.json.Decoder(_kind)


class Problems(ValueError):
    """Faults of a structured value; one line for each place."""

    def __init__(self, lines: Sequence[str]) -> None:
        super().__init__(joined("; ", lines))
        self.lines = lines


# --- JSON -> values ------------------------------------------------------------------------------


def parsed(kind: type[T], given: object) -> T:
    """Return `given` (decoded JSON) as a `kind`; raise `Problems` with the path of each fault."""
    infinite = list(_not_finite(given, ""))
    if infinite:
        raise Problems(infinite)
    try:
        value = msgspec.convert(given, kind)
    except msgspec.ValidationError as error:
        raise Problems([misfit_of(error)]) from error
    unknown = list(_unknown(given, msgspec.to_builtins(value), ""))
    if unknown:
        raise Problems(unknown)
    return value


def _not_finite(given: object, path: str) -> Iterator[str]:
    """Yield NaN and Infinity, which Python's JSON accepts, as faults."""
    if isinstance(given, float) and not math.isfinite(given):
        yield say("{place}: must be a finite number, not {value}", place=path, value=str(given))
    for key, item in _items(given):
        yield from _not_finite(item, _join(path, key))


def _unknown(given: object, known: object, path: str) -> Iterator[str]:
    """Yield unknown keys as faults: otherwise a misspelt field would count as absent."""
    known_items = dict(_items(known))
    for key, item in _items(given):
        if key not in known_items:
            fields = ", ".join(sorted(str(name) for name in known_items))
            place = _join(path, key)
            yield say("{place}: there is no such field (there are: {known})", place=place, known=fields)
        else:
            yield from _unknown(item, known_items[key], _join(path, key))


def _items(value: object) -> Iterator[tuple[str | int, object]]:
    if isinstance(value, dict):
        yield from value.items()
    elif isinstance(value, list | tuple):
        yield from enumerate(value)


def _join(path: str, key: str | int) -> str:
    if isinstance(key, int):
        return f"{path}[{key}]"
    return f"{path}.{key}" if path else key


# --- checks -------------------------------------------------------------------------------------

_LEAST = 1e-9  # of a value that must be above zero


def topic_problems(topics: Topics, ros: RosVersion = 1) -> Iterator[str]:
    """Yield faults of names, of types of this ROS, of poses, and duplicates."""
    for field, understood in TOPIC_TYPES[ros].items():
        source = getattr(topics, field)
        if source is None:
            continue
        name = source.name if isinstance(source, Topic) else source.topic
        yield from _name_problem(name, f"{field}.{'name' if isinstance(source, Topic) else 'topic'}")
        yield from _kind_problem(field, source.type, understood)
        if isinstance(source, Topic):
            yield from _other_problems(field, source, understood)
    if topics.depth:
        yield from _depth_problems(topics.depth)
    if topics.head:
        yield from _head_problems(topics.head)
    if topics.arm:
        yield from _arm_problems(topics.arm)
        yield from _unseen("arm", topics)
    for index, scan in enumerate(topics.scans):
        yield from _name_problem(scan.topic, f"scans[{index}].topic")
        yield from _pose_problems(scan, f"scans[{index}]")
    for index, sonar in enumerate(topics.sonars):
        yield from _sonar_problems(sonar, f"sonars[{index}]")
    yield from _camera_problems(topics.cameras, ros)
    if topics.navigation:
        yield from _navigation_problems(topics.navigation, ros)
    for limb, joints in topics.limbs.items():
        yield from _limb_problems(joints, limb, ros)
        yield from _unseen(limb, topics)
    for index, action in enumerate(topics.cancel_on_stop):
        yield from _name_problem(action, f"cancel_on_stop[{index}]")
    for index, language in enumerate(topics.languages):
        if not LANGUAGE.fullmatch(language):
            place = f"languages[{index}]"
            yield say(
                "{place}: {code} is not a language code such as en-GB", place=place, code=repr(language)
            )
    yield from _doublets([scan.topic for scan in topics.scans], "scans", "topic")
    yield from _doublets([sonar.frame_id for sonar in topics.sonars], "sonars", "frame_id")


def _other_problems(field: str, topic: Topic, understood: Sequence[str]) -> Iterator[str]:
    if topic.others and field not in WITH_OTHERS:
        yield say("{field}.others: only {known} may have other names", field=field, known=WITH_OTHERS[-1])
    for index, other in enumerate(topic.others):
        path = f"{field}.others[{index}]"
        yield from _name_problem(other.name, f"{path}.name")
        yield from _kind_problem(path, other.type, understood)
        if other.others:
            yield say("{field}.others: only {known} may have other names", field=path, known=WITH_OTHERS[-1])
    if field != "drive":
        yield from _doublets([topic.name, *(other.name for other in topic.others)], field, "others")


# Lowest and highest value of each entry of a depth camera.
_DEPTH_BOUNDS = {
    "fov": (0.2, 2.8, "rad"),
    "every_s": (0.02, 0.4, "s"),  # a picture is stale after 0.5 s
    "height_m": (0.1, 3.0, "m"),
    "own_m": (0.0, 0.3, "m"),
    "blind_m": (0.0, 1.0, "m"),
}


def _depth_problems(depth: DepthSource) -> Iterator[str]:
    for name, (lowest, highest, unit) in _DEPTH_BOUNDS.items():
        yield from _outside(f"depth.{name}", getattr(depth, name), lowest, highest, unit)
    if depth.info is not None:
        yield from _name_problem(depth.info, "depth.info")
    yield from _base_frame_problem("depth", depth)


def _camera_problems(cameras: list[CameraSource], ros: RosVersion) -> Iterator[str]:
    if len(cameras) > MOST_CAMERAS:
        yield say("cameras: at most {most}, not {count}", most=MOST_CAMERAS, count=len(cameras))
    for index, camera in enumerate(cameras):
        path = f"cameras[{index}]"
        if not CAMERA_NAME.fullmatch(camera.name):
            yield say(
                "{place}: {name} must be short: small letters, digits, - and _, such as head",
                place=f"{path}.name",
                name=repr(camera.name),
            )
        yield from _name_problem(camera.topic, f"{path}.topic")
        yield from _kind_problem(path, camera.type, CAMERA_TYPES[ros])
        if camera.info is not None:
            yield from _name_problem(camera.info, f"{path}.info")
        yield from _base_frame_problem(path, camera)
    if len({camera.base_frame for camera in cameras}) > 1:
        yield say("cameras: all must have the same base_frame")
    yield from _doublets([camera.name for camera in cameras], "cameras", "name")


def _head_problems(head: HeadSource) -> Iterator[str]:
    yield from _name_problem(head.topic, "head.topic")
    if head.point_head is not None:
        yield from _name_problem(head.point_head, "head.point_head")
    for name in ("pan_joint", "tilt_joint"):
        if not getattr(head, name):
            yield say("{place}: must name a joint", place=f"head.{name}")
    for name in ("pan_rad", "tilt_rad"):
        low, high = getattr(head, name)
        if not -math.pi <= low < high <= math.pi:
            place = f"head.{name}"
            yield say("{place}: must be two angles from -3.14 to 3.14 rad, the lower one first", place=place)
    yield from _outside("head.look_tilt", head.look_tilt, -math.pi / 2.0, math.pi / 2.0, "rad")


def _arm_problems(arm: ArmSource) -> Iterator[str]:
    if not arm.home:
        yield say("arm.home: must name the arm’s joints")
    if len(arm.links) < 2:
        yield say("arm.links: must name the arm’s links from shoulder to tip")
    if not 0.0 < arm.tolerance <= 0.5:
        value = f"{arm.tolerance:g}"
        yield say("arm.tolerance: must be above 0 and at most 0.5 rad or m, not {value}", value=value)
    yield from _outside("arm.radius_m", arm.radius_m, 0.02, 0.5, "m")
    yield from _outside("arm.reach_m", arm.reach_m, 0.1, 3.0, "m")
    for motion, discs in arm.postures.items():
        for index, (_, _, radius_m) in enumerate(discs):
            if radius_m <= 0.0:
                place = f"arm.postures.{motion}[{index}]"
                yield say("{place}: its radius must be above zero", place=place)


def _limb_problems(limb: LimbSource, path: str, ros: RosVersion) -> Iterator[str]:
    yield from _name_problem(limb.action, f"{path}.action")
    commands = (COMMANDS[ros],) if path == "gripper" else ()
    yield from _kind_problem(path, limb.type, LIMB_TYPES[ros] + commands)
    force = f"{path}.effort_n"
    if limb.is_command != (limb.effort_n is not None):
        yield say("{place}: belongs to the type {kind}, which needs it", place=force, kind=COMMANDS[ros])
    elif limb.effort_n is not None:
        yield from _outside(force, limb.effort_n, 0.0, 1000.0, "N")
    low, high = limb.range_m
    if not -1.0 <= low < high <= 1.0:
        place = f"{path}.range_m"
        yield say("{place}: must be two places from -1 to 1 m, the lower one first", place=place)
    yield from _outside(f"{path}.speed_mps", limb.speed_mps, 0.005, 0.5, "m/s")
    if not 1 <= len(limb.joints) <= 4 or not all(limb.joints):
        yield say("{place}: must name one to four joints", place=f"{path}.joints")
    yield from _doublets(limb.joints, path, "joints")


def _navigation_problems(navigation: NavigationSource, ros: RosVersion) -> Iterator[str]:
    for field in ("action", "velocity", "pose", "plan", "set_pose"):
        if (name := getattr(navigation, field)) is not None:
            yield from _name_problem(name, f"navigation.{field}")
    yield from _kind_problem("navigation", navigation.type, NAVIGATION_TYPES[ros])
    if navigation.frame != "map":
        frame = repr(navigation.frame)
        yield say("navigation.frame: must be 'map', the frame of the map, not {frame}", frame=frame)


def _sonar_problems(sonar: SonarSource, path: str) -> Iterator[str]:
    yield from _name_problem(sonar.topic, f"{path}.topic")
    yield from _pose_problems(sonar, path)
    if not sonar.frame_id:
        yield say("{place}: must name the sensor’s frame", place=f"{path}.frame_id")
    yield from _outside(f"{path}.fov", sonar.fov, _LEAST, math.pi, "rad")
    yield from _outside(f"{path}.max_range_m", sonar.max_range_m, _LEAST, 50.0, "m")


def _name_problem(name: str, path: str) -> Iterator[str]:
    if not FULL_NAME.fullmatch(name):
        yield say(
            "{place}: {name} is not a full ROS name such as /scan_raw (leading slash, letters, digits, _)",
            place=path,
            name=repr(name),
        )


def _kind_problem(path: str, kind: str, understood: Sequence[str]) -> Iterator[str]:
    if kind not in understood:
        yield say(
            "{place}: {kind} is not understood here, only {known}",
            place=f"{path}.type",
            kind=repr(kind),
            known=reduce(_or, understood),
        )


def _or(first: str, second: str) -> str:
    return say("{first} or {second}", first=first, second=second)


def _unseen(part: str, topics: Topics) -> Iterator[str]:
    if topics.joint_states is None:
        yield say("{part}: needs joint_states, from which its position is known", part=part)


def _base_frame_problem(path: str, camera: DepthSource | CameraSource) -> Iterator[str]:
    if not camera.base_frame:
        place = f"{path}.base_frame"
        yield say("{place}: must name the frame that lies on the floor below the robot", place=place)


def _outside(place: str, value: float, lowest: float, highest: float, unit: str) -> Iterator[str]:
    """Yield a fault if a value is outside its bounds. Its numbers have a point in every language, as JSON has them."""
    if not lowest <= value <= highest:
        yield say(
            "{place}: must be between {lowest} and {highest}{unit}, not {value}",
            place=place,
            lowest=f"{round(lowest, 3):g}",
            highest=f"{round(highest, 2):g}",
            unit=unit and f" {unit}",
            value=f"{value:g}",
        )


def _pose_problems(source: ScanSource | SonarSource, path: str) -> Iterator[str]:
    x, y, yaw = source.pose
    if max(abs(x), abs(y)) > 5.0:
        yield say(
            "{place}: ({x}, {y}) m is further than 5 m from the base; poses are in metres",
            place=f"{path}.pose",
            x=f"{x:g}",
            y=f"{y:g}",
        )
    if abs(yaw) > 2.0 * math.pi:
        yield say(
            "{place}: a yaw of {yaw} is more than a full turn; angles are in radians",
            place=f"{path}.pose",
            yaw=f"{yaw:g}",
        )


def _doublets(names: list[str], path: str, field: str) -> Iterator[str]:
    for index, name in enumerate(names):
        if name in names[:index]:
            yield say("{place}: {name} occurs twice", place=f"{path}[{index}].{field}", name=repr(name))


def footprint_problems(footprint: Footprint) -> Iterator[str]:
    """Yield faults: exactly one of disc and outline; an outline is convex, with the base frame's origin inside."""
    if (footprint.radius_m is None) == (footprint.outline is None):
        yield say('Give either "radius_m" (a disc) or "outline" (a convex polygon).')
    if footprint.radius_m is not None:
        yield from _outside("radius_m", footprint.radius_m, 0.05, 2.0, "m")
    if footprint.outline is not None:
        yield from _outline_problems(footprint.outline)


def _outline_problems(outline: list[tuple[float, float]]) -> Iterator[str]:
    if len(outline) < 3:
        yield say("outline: a polygon has at least 3 corners, not {count}", count=len(outline))
        return
    if max(abs(value) for corner in outline for value in corner) > 3.0:
        yield say("outline: a corner is further than 3 m from the base; corners are in metres")
    sides = list(zip(outline, outline[1:] + outline[:1], strict=True))
    turns = [_turn(a, b, c) for (a, b), (_, c) in zip(sides, sides[1:] + sides[:1], strict=True)]
    one_way = all(turn > 0.0 for turn in turns) or all(turn < 0.0 for turn in turns)
    if not one_way or abs(sum(turns)) > 2.5 * math.pi:  # a star also turns only one way, but two full turns
        yield say("outline: the corners must go once around, in order, and form a convex polygon")
        return
    if not all(_turn(a, b, (0.0, 0.0)) * turns[0] > 0.0 for a, b in sides):
        yield say("outline: the base frame’s origin (0, 0) must lie inside")


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return the angle by which the path a, b, c turns left at b; 0 if two corners are the same."""
    ahead, onward = (b[0] - a[0], b[1] - a[1]), (c[0] - b[0], c[1] - b[1])
    cross = ahead[0] * onward[1] - ahead[1] * onward[0]
    along = ahead[0] * onward[0] + ahead[1] * onward[1]
    return math.atan2(cross, along)


# Lowest and highest value of each gate parameter. Every base fits within them, but they do not allow to turn the gate
# off.
PARAMETER_BOUNDS = {
    "lateral_margin_m": (0.01, 0.5),
    "front_margin_m": (0.03, 1.0),
    "hard_margin_m": (0.005, 0.2),
    "deceleration_share": (0.1, 0.9),
    "latency_s": (0.1, 1.0),
    "latency_spare_s": (0.0, 0.8),
    "operator_delay_s": (0.1, 1.0),
    "creep_mps": (0.02, 0.2),
    "between_sonars_mps": (0.02, 1.0),
    "near_miss_s": (0.02, 1.0),
}
# For these parameters a smaller value is more careful; for all others a larger value is.
CAREFUL_WHEN_SMALL = {"deceleration_share", "operator_delay_s", "creep_mps", "between_sonars_mps"}


def parameter_problems(parameters: Parameters) -> Iterator[str]:
    """Yield the parameters that are outside their bounds."""
    for name, (lowest, highest) in PARAMETER_BOUNDS.items():
        yield from _outside(name, getattr(parameters, name), lowest, highest, "")


def loosened_parameters(given: Parameters, profile: Parameters) -> Iterator[str]:
    """Yield the parameters that are less careful in `given` than in `profile`."""
    for name in PARAMETER_BOUNDS:
        mine, theirs = getattr(given, name), getattr(profile, name)
        if mine < theirs and name not in CAREFUL_WHEN_SMALL:
            yield below(f"gate.{name}", mine, theirs)
        if mine > theirs and name in CAREFUL_WHEN_SMALL:
            yield above(f"gate.{name}", mine, theirs)


def below(place: str, mine: float, theirs: float) -> Sentence:
    """Return the fault of a robot's value that must not be below its profile's."""
    words = "{place}: {mine} is below the profile’s {theirs}; a robot may only tighten"
    return say(words, place=place, mine=f"{mine:g}", theirs=f"{theirs:g}")


def above(place: str, mine: float, theirs: float) -> Sentence:
    """Return the fault of a robot's value that must not be above its profile's."""
    words = "{place}: {mine} is above the profile’s {theirs}; a robot may only tighten"
    return say(words, place=place, mine=f"{mine:g}", theirs=f"{theirs:g}")


def unknown_steps(given: object) -> Iterator[str]:
    """Yield steps with an unknown name, in decoded JSON."""
    known = ", ".join(sorted(STEPS))
    for index, step in enumerate(given if isinstance(given, list | tuple) else ()):
        if isinstance(step, dict) and step.get("step") not in STEPS:
            yield say(
                "{place}: there is no step {name} (there are: {known})",
                place=f"stick[{index}].step",
                name=repr(step.get("step")),
                known=known,
            )


def stick_problems(chain: StickChain) -> Iterator[str]:
    """Yield faults: each step may occur only once, and only one filter may reduce tremor."""
    names = [step.__struct_config__.tag for step in chain.stick]
    yield from _doublets([str(name) for name in names], "stick", "step")
    if sum(isinstance(step, SMOOTHING) for step in chain.stick) > 1:
        yield say("stick: one of one_euro and mean steadies the stick, not both")


def checked(problems: Callable[[V], Iterator[str]], value: V) -> V:
    """Return `value`; raise `Problems` if `problems` yields any faults."""
    lines = list(problems(value))
    if lines:
        raise Problems(lines)
    return value
