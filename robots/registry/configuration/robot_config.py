"""Effective configuration of one robot: its own entries replace those of its profile; see `of`.

All functions raise `profile_schema.Problems` if the JSON of profile or robot is wrong. JSON is checked when it is saved
through the admin or `robots.registry.services`, but a later edit of the profile may make a robot's JSON wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

import msgspec
from msgspec import Struct

from robots.registry.configuration.profile_schema import (
    CAREFUL_WHEN_SMALL,
    Footprint,
    Overrides,
    Problems,
    StickChain,
    Tightening,
    above,
    below,
    checked,
    footprint_problems,
    loosened_parameters,
    parameter_problems,
    parsed,
    stick_problems,
    topic_problems,
    unknown_steps,
)
from robots.shared.configuration import bridge_config
from robots.shared.configuration.bridge_config import ArmSource, DepthSource, Topics
from robots.shared.configuration.gate_profile import DepthView, GateProfile, Limits, Parameters
from robots.shared.configuration.input_filters import StickStep
from robots.shared.configuration.robot_ros import RosVersion
from robots.shared.sentences import say

BEGINNER_MPS = 0.4  # highest speed of a full stick before a person raises the speed share
MAY_BE_ZERO = {"reverse_mps", "lateral_mps"}  # 0 forbids this motion; the other limits must be above 0


class ProfileFields(Protocol):
    """Fields of `models.RobotProfile` that this module reads, and those of `Limits`."""

    forward_mps: float
    reverse_mps: float
    lateral_mps: float
    default_share: float
    ros: int
    drive_topic: str
    drive_type: str
    footprint: Any
    topics: Any
    gate: Any
    stick: Any


class RobotFields(Protocol):
    """Fields of `models.Robot` that this module reads."""

    @property
    def profile(self) -> ProfileFields: ...

    enabled: bool
    namespace: str
    drive_topic: str
    default_share: float | None
    max_share: float
    overrides: Any
    stick: Any


# --- of a profile --------------------------------------------------------------------------------


def footprint(profile: ProfileFields) -> Footprint:
    """Return the footprint; the corners of an outline are put into counter-clockwise order."""
    given = checked(footprint_problems, parsed(Footprint, profile.footprint))
    if given.outline is not None and _clockwise(given.outline):
        return Footprint(outline=given.outline[::-1])
    return given


def _clockwise(outline: list[tuple[float, float]]) -> bool:
    following = outline[1:] + outline[:1]
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(outline, following, strict=True)) < 0.0


def profile_topics(profile: ProfileFields) -> Topics:
    """Return the ROS interface of this profile."""
    return _topics(profile, profile.drive_topic, profile.topics)


def profile_parameters(profile: ProfileFields) -> Parameters:
    """Return the gate's parameters for this profile."""
    return checked(parameter_problems, parsed(Parameters, profile.gate))


def profile_stick(profile: ProfileFields) -> tuple[StickStep, ...]:
    """Return the input filters of this profile."""
    return _stick(profile.stick)


def _stick(given: object) -> tuple[StickStep, ...]:
    checked(unknown_steps, given)
    return checked(stick_problems, parsed(StickChain, {"stick": given})).stick


def _topics(profile: ProfileFields, drive_topic: str, rest: object) -> Topics:
    if not isinstance(rest, dict):
        raise Problems([say("Write an object with odometry, scans and so on.")])
    if "drive" in rest:
        raise Problems([say('drive: belongs into the field "drive topic"')])
    ros: RosVersion = 2 if profile.ros == 2 else 1
    drive = msgspec.to_builtins(bridge_config.drive_topic(drive_topic, profile.drive_type, ros))
    return checked(lambda given: topic_problems(given, ros), parsed(Topics, {"drive": drive, **rest}))


# --- of a robot ----------------------------------------------------------------------------------


class Effective(Struct, frozen=True):
    """Effective configuration of one robot."""

    topics: Topics
    gate: GateProfile
    stick: tuple[StickStep, ...]
    default_share: float  # speed share when a page opens


def of(robot: RobotFields) -> Effective:
    """Return the effective configuration: of each limit and parameter, the more careful of profile and robot."""
    profile, own = robot.profile, overrides(robot)
    expected = profile_topics(profile)
    interface = _own_topics(robot, own, expected)
    body, depth = footprint(profile), interface.depth
    gate = GateProfile(
        limits=_limits(profile, own),
        radius_m=body.radius_m,
        outline=None if body.outline is None else tuple(body.outline),
        scan_poses={scan.topic: scan.pose for scan in interface.scans},
        sonar_poses={sonar.frame_id: sonar.pose for sonar in interface.sonars},
        sonar_fov={sonar.frame_id: sonar.fov for sonar in interface.sonars},
        # The profile's limits for depth camera and arm also apply to a robot without them.
        has_depth=depth is not None or expected.depth is not None,
        blind_mps=_lower(profile, own, "blind_mps"),
        parameters=_careful(_own_parameters(robot, own), profile_parameters(profile)),
        has_arm=interface.arm is not None or expected.arm is not None,
        depth=DepthView(depth.height_m, depth.own_m, depth.blind_m) if depth else None,
    )
    return Effective(interface, gate, stick(robot), _default_share(robot, gate.limits))


def overrides(robot: RobotFields) -> Overrides:
    """Return the robot's own entries."""
    return parsed(Overrides, robot.overrides)


def topics(robot: RobotFields) -> Topics:
    """Return only the robot's ROS interface. Other parts of its entry may be wrong."""
    return _own_topics(robot, overrides(robot), profile_topics(robot.profile))


def _own_topics(robot: RobotFields, own: Overrides, expected: Topics) -> Topics:
    merged = {**robot.profile.topics, **own.topics}
    given = _topics(robot.profile, robot.drive_topic or robot.profile.drive_topic, merged)
    return in_namespace(robot, checked(lambda given: _sensor_faults(given, expected), given))


V = TypeVar("V")


def in_namespace(robot: RobotFields, named: V) -> V:
    """Return topics, or a name, as this robot has them: the registry's names are without the robot's namespace."""
    if robot.profile.ros != 2 or not robot.namespace:
        return named
    return msgspec.convert(_prefixed(msgspec.to_builtins(named), robot.namespace), type(named))


def _prefixed(value: Any, namespace: str) -> Any:
    """Put the namespace before all names within the value: only they begin with a slash."""
    match value:
        case str():
            return namespace + value if value.startswith("/") else value
        case list() | tuple():
            return [_prefixed(item, namespace) for item in value]
        case dict():
            return {key: _prefixed(item, namespace) for key, item in value.items()}
    return value


def _sensor_faults(given: Topics, profile: Topics) -> Iterator[str]:
    """Yield faults of the sensors: a robot may have other sensors than its profile, but not fewer."""
    for kind in ("scans", "sonars"):
        mine, theirs = len(getattr(given, kind)), len(getattr(profile, kind))
        if mine < theirs:
            words = "{kind}: {mine} here, {theirs} in the profile; a robot must have at least as many as its profile"
            yield say(words, kind=kind, mine=mine, theirs=theirs)
    if given.depth and profile.depth:
        yield from _looser_depth(given.depth, profile.depth)
    if given.arm and profile.arm:
        yield from _looser_arm(given.arm, profile.arm)


def _looser_arm(given: ArmSource, profile: ArmSource) -> Iterator[str]:
    """Yield entries by which the arm would count as thinner, or as folded earlier, than in the profile."""
    if given.radius_m < profile.radius_m:
        yield below("arm.radius_m", given.radius_m, profile.radius_m)
    if given.tolerance > profile.tolerance:
        yield above("arm.tolerance", given.tolerance, profile.tolerance)


def _looser_depth(given: DepthSource, profile: DepthSource) -> Iterator[str]:
    """Yield entries by which the robot's depth camera would ignore points that count in the profile."""
    if given.height_m < profile.height_m:
        yield below("depth.height_m", given.height_m, profile.height_m)
    if given.own_m > profile.own_m:
        yield above("depth.own_m", given.own_m, profile.own_m)
    if given.blind_m < profile.blind_m:
        yield below("depth.blind_m", given.blind_m, profile.blind_m)


def _careful(own: Parameters, theirs: Parameters) -> Parameters:
    """Return the more careful parameters of the two, one by one."""
    careful = {
        name: (min if name in CAREFUL_WHEN_SMALL else max)(getattr(own, name), getattr(theirs, name))
        for name in Parameters.__struct_fields__
    }
    return Parameters(**careful)


def _own_parameters(robot: RobotFields, own: Overrides) -> Parameters:
    return checked(parameter_problems, parsed(Parameters, {**robot.profile.gate, **own.gate}))


def _limits(profile: ProfileFields, own: Overrides) -> Limits:
    return Limits(**{name: _lower(profile, own, name) for name in Limits.__struct_fields__})


def _lower(profile: ProfileFields, own: Overrides, name: str) -> float:
    """Return the lower limit of profile and robot: if a profile's limit is lowered later, it applies to every robot."""
    theirs: float = getattr(profile, name)
    mine: float | None = getattr(own.limits, name)
    return theirs if mine is None else min(mine, theirs)


def _default_share(robot: RobotFields, limits: Limits) -> float:
    """Return the share when a page opens: at most the robot's largest share, and at most `BEGINNER_MPS`."""
    fastest_mps = _fastest_mps(limits)
    beginner = BEGINNER_MPS / fastest_mps if fastest_mps > BEGINNER_MPS else 1.0
    return min(_asked_share(robot), robot.max_share, beginner)


def _asked_share(robot: RobotFields) -> float:
    return robot.profile.default_share if robot.default_share is None else robot.default_share


def _fastest_mps(given: Limits | ProfileFields) -> float:
    return max(given.forward_mps, given.reverse_mps, given.lateral_mps)


def stick(robot: RobotFields) -> tuple[StickStep, ...]:
    """Return the input filters: the robot's own, or its profile's."""
    return profile_stick(robot.profile) if robot.stick is None else _stick(robot.stick)


# --- checks before saving ------------------------------------------------------------------------


def check_overrides(robot: RobotFields) -> None:
    """Raise `Problems` if a robot's own entries are malformed or less strict than its profile.

    For a disabled robot only the form is checked: after an edit of its profile it must still be possible to disable
    the robot.
    """
    own = overrides(robot)
    if not robot.enabled:
        return
    with _under("topics"):
        topics(robot)
    with _under("gate"):
        tuned = _own_parameters(robot, own)
    lines = [*_loosened_limits(own.limits, robot.profile)]
    lines += loosened_parameters(tuned, profile_parameters(robot.profile))
    if lines:
        raise Problems(lines)


@contextmanager
def _under(field: str) -> Iterator[None]:
    """Context: put `field` before the place of each problem."""
    try:
        yield
    except Problems as problems:
        raise Problems(
            [say("{field}.{line}", field=field, line=line) for line in problems.lines]
        ) from problems


def _loosened_limits(own: Tightening, profile: ProfileFields) -> Iterator[str]:
    for name in Tightening.__struct_fields__:
        mine: float | None = getattr(own, name)
        theirs: float = getattr(profile, name)
        if mine is not None and mine > theirs:
            yield above(f"limits.{name}", mine, theirs)
        if mine is not None and mine <= 0.0 < theirs and name not in MAY_BE_ZERO:
            yield say("{place}: must be above 0, not {value}", place=f"limits.{name}", value=f"{mine:g}")
        if mine is not None and mine < 0.0 and name in MAY_BE_ZERO:
            yield say("{place}: must not be negative, {value} is", place=f"limits.{name}", value=f"{mine:g}")


def check_profile_share(profile: ProfileFields) -> None:
    """Raise `Problems` if the default speed share of this profile gives more than `BEGINNER_MPS`."""
    _check_share(profile.default_share, _fastest_mps(profile))


def check_robot_share(robot: RobotFields) -> None:
    """Raise `Problems` as `check_profile_share`, for the share of this robot, unless the robot is disabled."""
    if robot.enabled:
        limits = _limits(robot.profile, overrides(robot))
        _check_share(min(_asked_share(robot), robot.max_share), _fastest_mps(limits))


def _check_share(share: float, fastest_mps: float) -> None:
    if share * fastest_mps > BEGINNER_MPS + 1e-9:
        raise Problems(
            [
                say(
                    "{share} of {fastest} m/s is {speed} m/s; the first speed may be at most {most} m/s, "
                    "so the share at most {largest}.",
                    share=f"{share:g}",
                    fastest=f"{fastest_mps:g}",
                    speed=f"{share * fastest_mps:.2g}",
                    most=f"{BEGINNER_MPS:g}",
                    largest=f"{BEGINNER_MPS / fastest_mps:.2g}",
                )
            ]
        )
