"""The structured parts of a profile or robot: from JSON to values, with checks.

People edit these parts as JSON in the admin, so every error names its place: "scans[0].pose[1]: Expected
a number, got text". This module does not use the database.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from robots.shared.configuration.bridge_config import (
    GRIPPER_COMMAND,
    TOPIC_TYPES,
    TRAJECTORY,
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
from robots.shared.sentences import joined
from robots.shared.wire import MOST_CAMERAS

T = TypeVar("T", bound=Struct)
V = TypeVar("V")

CAMERA_TYPES = ("sensor_msgs/CompressedImage", "sensor_msgs/Image")
CAMERA_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,39}")
LANGUAGE = re.compile(r"(?=.{2,35}$)[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*")  # BCP 47
_PLACE = re.compile(r"(?P<what>.*?)(?: - at `(?:key in )?\$(?P<path>.*)`)?", re.DOTALL)
_WORDS = {
    "`float`": "a number",
    "`int`": "a whole number",
    "`str`": "text",
    "`bool`": "true or false",
    "`array`": "a list",
    "`object`": "an object",
    "`null`": "null",
}


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
        raise Problems([_in_words(str(error))]) from error
    unknown = list(_unknown(given, msgspec.to_builtins(value), ""))
    if unknown:
        raise Problems(unknown)
    return value


def _in_words(message: str) -> str:
    match = _PLACE.fullmatch(message)
    what, path = (match["what"], match["path"]) if match else (message, None)
    for word, plain in _WORDS.items():
        what = what.replace(word, plain)
    place = (path or "").removeprefix(".")
    return f"{place}: {what}" if place else what


def _not_finite(given: object, path: str) -> Iterator[str]:
    """Yield NaN and Infinity, which Python's JSON accepts, as faults."""
    if isinstance(given, float) and not math.isfinite(given):
        yield f"{path}: must be a finite number, not {given}"
    for key, item in _items(given):
        yield from _not_finite(item, _join(path, key))


def _unknown(given: object, known: object, path: str) -> Iterator[str]:
    """Yield unknown keys as faults: otherwise a misspelt field would count as absent."""
    known_items = dict(_items(known))
    for key, item in _items(given):
        if key not in known_items:
            fields = ", ".join(sorted(str(name) for name in known_items))
            yield f"{_join(path, key)}: there is no such field (there are: {fields})"
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


def topic_problems(topics: Topics) -> Iterator[str]:
    """Yield faults of names, types and poses, and duplicates."""
    for field, understood in TOPIC_TYPES.items():
        source = getattr(topics, field)
        if source is None:
            continue
        name = source.name if isinstance(source, Topic) else source.topic
        yield from _name_problem(name, f"{field}.{'name' if isinstance(source, Topic) else 'topic'}")
        if source.type not in understood:
            yield f"{field}.type: {source.type!r} is not understood here, only {' or '.join(understood)}"
    if topics.depth:
        yield from _depth_problems(topics.depth)
    if topics.head:
        yield from _head_problems(topics.head)
    if topics.arm:
        yield from _arm_problems(topics.arm)
        if topics.joint_states is None:
            yield "arm: needs joint_states, from which its position is known"
    for index, scan in enumerate(topics.scans):
        yield from _name_problem(scan.topic, f"scans[{index}].topic")
        yield from _pose_problems(scan, f"scans[{index}]")
    for index, sonar in enumerate(topics.sonars):
        yield from _sonar_problems(sonar, f"sonars[{index}]")
    yield from _camera_problems(topics.cameras)
    if topics.navigation:
        yield from _navigation_problems(topics.navigation)
    for limb, joints in topics.limbs.items():
        yield from _limb_problems(joints, limb)
        if topics.joint_states is None:
            yield f"{limb}: needs joint_states, from which its position is known"
    for index, action in enumerate(topics.cancel_on_stop):
        yield from _name_problem(action, f"cancel_on_stop[{index}]")
    for index, language in enumerate(topics.languages):
        if not LANGUAGE.fullmatch(language):
            yield f"languages[{index}]: {language!r} is not a language code such as en-GB"
    yield from _doublets([scan.topic for scan in topics.scans], "scans", "topic")
    yield from _doublets([sonar.frame_id for sonar in topics.sonars], "sonars", "frame_id")


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
        value = getattr(depth, name)
        if not lowest <= value <= highest:
            yield f"depth.{name}: must be between {lowest:g} and {highest:g} {unit}, not {value:g}"
    if depth.info is not None:
        yield from _name_problem(depth.info, "depth.info")
    if not depth.base_frame:
        yield "depth.base_frame: must name the frame that lies on the floor below the robot"


def _camera_problems(cameras: list[CameraSource]) -> Iterator[str]:
    if len(cameras) > MOST_CAMERAS:
        yield f"cameras: at most {MOST_CAMERAS}, not {len(cameras)}"
    for index, camera in enumerate(cameras):
        path = f"cameras[{index}]"
        if not CAMERA_NAME.fullmatch(camera.name):
            yield f"{path}.name: {camera.name!r} must be short: small letters, digits, - and _, such as head"
        yield from _name_problem(camera.topic, f"{path}.topic")
        if camera.type not in CAMERA_TYPES:
            yield f"{path}.type: {camera.type!r} is not understood here, only {' or '.join(CAMERA_TYPES)}"
        if camera.info is not None:
            yield from _name_problem(camera.info, f"{path}.info")
        if not camera.base_frame:
            yield f"{path}.base_frame: must name the frame that lies on the floor below the robot"
    if len({camera.base_frame for camera in cameras}) > 1:
        yield "cameras: all must have the same base_frame"
    yield from _doublets([camera.name for camera in cameras], "cameras", "name")


def _head_problems(head: HeadSource) -> Iterator[str]:
    yield from _name_problem(head.topic, "head.topic")
    if head.point_head is not None:
        yield from _name_problem(head.point_head, "head.point_head")
    for name in ("pan_joint", "tilt_joint"):
        if not getattr(head, name):
            yield f"head.{name}: must name a joint"
    for name in ("pan_rad", "tilt_rad"):
        low, high = getattr(head, name)
        if not -math.pi <= low < high <= math.pi:
            yield f"head.{name}: must be two angles from -3.14 to 3.14 rad, the lower one first"
    if abs(head.look_tilt) > math.pi / 2.0:
        yield f"head.look_tilt: must be between -1.57 and 1.57 rad, not {head.look_tilt:g}"


def _arm_problems(arm: ArmSource) -> Iterator[str]:
    if not arm.home:
        yield "arm.home: must name the arm’s joints"
    if len(arm.links) < 2:
        yield "arm.links: must name the arm’s links from shoulder to tip"
    if not 0.0 < arm.tolerance <= 0.5:
        yield f"arm.tolerance: must be above 0 and at most 0.5 rad or m, not {arm.tolerance:g}"
    if not 0.02 <= arm.radius_m <= 0.5:
        yield f"arm.radius_m: must be between 0.02 and 0.5 m, not {arm.radius_m:g}"
    if not 0.1 <= arm.reach_m <= 3.0:
        yield f"arm.reach_m: must be between 0.1 and 3 m, not {arm.reach_m:g}"
    for motion, discs in arm.postures.items():
        for index, (_, _, radius_m) in enumerate(discs):
            if radius_m <= 0.0:
                yield f"arm.postures.{motion}[{index}]: its radius must be above zero"


def _limb_problems(limb: LimbSource, path: str) -> Iterator[str]:
    yield from _name_problem(limb.action, f"{path}.action")
    types = (TRAJECTORY, GRIPPER_COMMAND) if path == "gripper" else (TRAJECTORY,)
    if limb.type not in types:
        yield f"{path}.type: {limb.type!r} is not understood here, only {' or '.join(types)}"
    if (limb.type == GRIPPER_COMMAND) != (limb.effort_n is not None):
        yield f"{path}.effort_n: belongs to the type {GRIPPER_COMMAND}, which needs it"
    elif limb.effort_n is not None and not 0.0 <= limb.effort_n <= 1000.0:
        yield f"{path}.effort_n: must be between 0 and 1000 N, not {limb.effort_n:g}"
    low, high = limb.range_m
    if not -1.0 <= low < high <= 1.0:
        yield f"{path}.range_m: must be two places from -1 to 1 m, the lower one first"
    if not 0.005 <= limb.speed_mps <= 0.5:
        yield f"{path}.speed_mps: must be between 0.005 and 0.5 m/s, not {limb.speed_mps:g}"
    if not 1 <= len(limb.joints) <= 4 or not all(limb.joints):
        yield f"{path}.joints: must name one to four joints"
    yield from _doublets(limb.joints, path, "joints")


NAVIGATION_TYPES = ("move_base_msgs/MoveBaseAction",)


def _navigation_problems(navigation: NavigationSource) -> Iterator[str]:
    for field in ("action", "velocity", "pose", "plan", "set_pose"):
        if (name := getattr(navigation, field)) is not None:
            yield from _name_problem(name, f"navigation.{field}")
    if navigation.type not in NAVIGATION_TYPES:
        yield f"navigation.type: {navigation.type!r} is not understood here, only {' or '.join(NAVIGATION_TYPES)}"
    if navigation.frame != "map":
        yield f"navigation.frame: must be 'map', the frame of the map, not {navigation.frame!r}"


def _sonar_problems(sonar: SonarSource, path: str) -> Iterator[str]:
    yield from _name_problem(sonar.topic, f"{path}.topic")
    yield from _pose_problems(sonar, path)
    if not sonar.frame_id:
        yield f"{path}.frame_id: must name the sensor’s frame"
    if not 0.0 < sonar.fov <= math.pi:
        yield f"{path}.fov: must be between 0 and 3.14 rad, not {sonar.fov:g}"
    if not 0.0 < sonar.max_range_m <= 50.0:
        yield f"{path}.max_range_m: must be between 0 and 50 m, not {sonar.max_range_m:g}"


def _name_problem(name: str, path: str) -> Iterator[str]:
    if not FULL_NAME.fullmatch(name):
        yield f"{path}: {name!r} is not a full ROS name such as /scan_raw (leading slash, letters, digits, _)"


def _pose_problems(source: ScanSource | SonarSource, path: str) -> Iterator[str]:
    x, y, yaw = source.pose
    if max(abs(x), abs(y)) > 5.0:
        yield f"{path}.pose: ({x:g}, {y:g}) m is further than 5 m from the base; poses are in metres"
    if abs(yaw) > 2.0 * math.pi:
        yield f"{path}.pose: a yaw of {yaw:g} is more than a full turn; angles are in radians"


def _doublets(names: list[str], path: str, field: str) -> Iterator[str]:
    for index, name in enumerate(names):
        if name in names[:index]:
            yield f"{path}[{index}].{field}: {name!r} occurs twice"


def footprint_problems(footprint: Footprint) -> Iterator[str]:
    """Yield faults: exactly one of disc and outline; an outline is convex, with the base frame's origin inside."""
    if (footprint.radius_m is None) == (footprint.outline is None):
        yield 'Give either "radius_m" (a disc) or "outline" (a convex polygon).'
    if footprint.radius_m is not None and not 0.05 <= footprint.radius_m <= 2.0:
        yield f"radius_m: must be between 0.05 and 2 m, not {footprint.radius_m:g}"
    if footprint.outline is not None:
        yield from _outline_problems(footprint.outline)


def _outline_problems(outline: list[tuple[float, float]]) -> Iterator[str]:
    if len(outline) < 3:
        yield f"outline: a polygon has at least 3 corners, not {len(outline)}"
        return
    if max(abs(value) for corner in outline for value in corner) > 3.0:
        yield "outline: a corner is further than 3 m from the base; corners are in metres"
    sides = list(zip(outline, outline[1:] + outline[:1], strict=True))
    turns = [_turn(a, b, c) for (a, b), (_, c) in zip(sides, sides[1:] + sides[:1], strict=True)]
    one_way = all(turn > 0.0 for turn in turns) or all(turn < 0.0 for turn in turns)
    if not one_way or abs(sum(turns)) > 2.5 * math.pi:  # a star also turns only one way, but two full turns
        yield "outline: the corners must go once around, in order, and form a convex polygon"
        return
    if not all(_turn(a, b, (0.0, 0.0)) * turns[0] > 0.0 for a, b in sides):
        yield "outline: the base frame’s origin (0, 0) must lie inside"


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
        value = getattr(parameters, name)
        if not lowest <= value <= highest:
            yield f"{name}: must be between {lowest:g} and {highest:g}, not {value:g}"


def loosened_parameters(given: Parameters, profile: Parameters) -> Iterator[str]:
    """Yield the parameters that are less careful in `given` than in `profile`."""
    for name in PARAMETER_BOUNDS:
        mine, theirs = getattr(given, name), getattr(profile, name)
        if mine < theirs and name not in CAREFUL_WHEN_SMALL:
            yield f"gate.{name}: {mine:g} is below the profile’s {theirs:g}; a robot may only tighten"
        if mine > theirs and name in CAREFUL_WHEN_SMALL:
            yield f"gate.{name}: {mine:g} is above the profile’s {theirs:g}; a robot may only tighten"


def unknown_steps(given: object) -> Iterator[str]:
    """Yield steps with an unknown name, in decoded JSON."""
    known = ", ".join(sorted(STEPS))
    for index, step in enumerate(given if isinstance(given, list | tuple) else ()):
        if isinstance(step, dict) and step.get("step") not in STEPS:
            yield f"stick[{index}].step: there is no step {step.get('step')!r} (there are: {known})"


def stick_problems(chain: StickChain) -> Iterator[str]:
    """Yield faults: each step may occur only once, and only one filter may reduce tremor."""
    names = [step.__struct_config__.tag for step in chain.stick]
    yield from _doublets([str(name) for name in names], "stick", "step")
    if sum(isinstance(step, SMOOTHING) for step in chain.stick) > 1:
        yield "stick: one of one_euro and mean steadies the stick, not both"


def checked(problems: Callable[[V], Iterator[str]], value: V) -> V:
    """Return `value`; raise `Problems` if `problems` yields any faults."""
    lines = list(problems(value))
    if lines:
        raise Problems(lines)
    return value
