"""Faults of a simulated robot, for tests and benchmarks."""

from __future__ import annotations

from dataclasses import dataclass, fields


class FaultError(ValueError):
    """The fault does not exist, or its value is no number."""


@dataclass(frozen=True)
class Faults:
    """All present faults. Read and replaced as a whole."""

    laser_dead: bool = False  # no scans
    laser_frozen: bool = False  # the same scan with the same stamp is repeated
    laser_nan: bool = False  # scans contain only nan
    laser_ahead_s: float = 0.0  # its scans have the stamps of another clock
    sonar_dead: bool = False
    odom_dead: bool = False
    odom_frozen: bool = False
    depth_dead: bool = False
    camera_dead: bool = False  # the head's colour camera, as for all faults named camera_
    camera_frozen: bool = False  # the same picture with the same stamp is repeated
    camera_corrupt: bool = False  # random bytes after the header; raw: rows of 7 bytes
    camera_truncated: bool = False  # half of the bytes
    camera_huge: bool = False  # declares 20,000 x 20,000 pixels
    camera_bomb: bool = False  # a PNG of 400 kB that needs 400 MB when decoded
    camera_zero: bool = False  # no pixels, no bytes
    camera_encoding_changes: bool = False  # with each picture: JPEG and PNG; raw: rgb8, bgr8 and mono8
    camera_rate_hz: float = 0.0  # most pictures a second; 0: the usual rate
    camera_info_wrong: bool = False  # in turn: zeros, another size, nan
    motion_fails: bool = False  # motions are aborted half-way
    joints_stuck: bool = False  # joints stay where they are, whatever their controllers do
    joints_dead: bool = False  # no joint states
    controllers_silent: bool = False  # trajectory controllers take goals and never answer
    navigation_blind: bool = False  # drives straight to the goal and ignores obstacles
    navigation_backs: bool = False  # with navigation_blind: drives backwards at the same speed
    navigation_fails: bool = False  # finds no plan
    navigation_silent: bool = False  # takes goals and never answers: no status, feedback or result
    navigation_goes_on: bool = False  # confirms a cancel and drives on
    navigation_pauses: bool = False  # confirms a cancel, stands for 4 s and drives on
    navigation_answers_another: bool = False  # its results name another goal
    localisation_dead: bool = False  # no transform from map to odom
    localisation_jumps: bool = False  # the believed pose is 1.5 m off
    motor_hot: bool = False  # a motor warns of its temperature
    part_broken: bool = False  # one part reports an error
    diagnostics_dead: bool = False  # no diagnostics
    diagnostics_flood: bool = False  # 300 parts with new names and long texts, in each tick
    diagnostics_garbage: bool = False  # invalid levels, temperatures and names
    clock_ahead_s: float = 0.0  # all stamps are of a clock that is set so much ahead
    command_delay_s: float = 0.0  # commands reach the controller late
    brake_share: float = 1.0  # of the controller's nominal deceleration
    slip_share: float = 0.0  # share of the wheels' path that the robot does not travel


def parse_faults(text: str) -> Faults:
    """Parse ``none``, or names and ``name=value`` with commas, such as ``laser_dead,brake_share=0.6``."""
    kinds = {field.name: type(field.default) for field in fields(Faults)}
    wrong: dict[str, bool | float] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, _, value = item.partition("=")
        if name == "none":
            continue
        if name not in kinds or (kinds[name] is bool) == bool(value):
            raise FaultError(f"{item!r} is none of: {', '.join(kinds)}")
        try:
            wrong[name] = True if kinds[name] is bool else float(value)
        except ValueError:
            raise FaultError(f"{item!r}: {value!r} is no number") from None
    if wrong.get("slip_share", 0.0) >= 1.0:
        raise FaultError("slip_share must be less than 1")
    return Faults(**wrong)  # type: ignore[arg-type]  # each value has its field's type
