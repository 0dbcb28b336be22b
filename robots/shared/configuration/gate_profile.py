"""Limits and parameters of the gate (`Parameters`: its margins)."""

from __future__ import annotations

from msgspec import Struct


class Parameters(Struct, frozen=True):
    """The parameters of docs/gate.md."""

    lateral_margin_m: float = 0.03  # m_lat
    front_margin_m: float = 0.08  # m_front
    hard_margin_m: float = 0.01  # m_hard
    deceleration_share: float = 0.65  # a = share x limit
    latency_s: float = 0.20  # T, before the first measurement
    latency_spare_s: float = 0.1  # T may suddenly grow by this; always included
    operator_delay_s: float = 0.30  # round trip to the page; a longer one limits speed
    creep_mps: float = 0.10  # v_creep
    near_miss_s: float = 0.08  # c_lat
    between_sonars_mps: float = 0.10  # where only sonars look: nothing watches between and above them


class Limits(Struct, frozen=True):
    """Limits of the base: speeds and accelerations."""

    forward_mps: float
    reverse_mps: float  # positive
    lateral_mps: float  # 0 for a differential base
    turn_radps: float
    linear_mps2: float
    angular_radps2: float


class DepthView(Struct, frozen=True):
    """The gate's data about a depth camera on the robot's head, and the robot below it."""

    height_m: float  # of the robot with its torso at the lowest
    own_m: float = 0.05  # points nearer to the footprint are the robot itself
    blind_m: float = 0.5  # along its axis; it cannot measure nearer points


class GateProfile(Struct, frozen=True):
    """The gate's configuration of a robot.

    The footprint (base frame) is the first of these that is given: the union of `discs` (x, y, radius);
    `outline`, convex and counter-clockwise; a disc of `radius_m` about the origin. `scan_poses` and
    `sonar_poses` map a source's name (scan topic, sonar frame_id) to its pose.
    """

    limits: Limits
    radius_m: float | None
    outline: tuple[tuple[float, float], ...] | None
    scan_poses: dict[str, tuple[float, float, float]]
    sonar_poses: dict[str, tuple[float, float, float]]
    sonar_fov: dict[str, float]
    has_depth: bool
    blind_mps: float  # speed in directions or heights without a sensor
    parameters: Parameters = Parameters()
    discs: tuple[tuple[float, float, float], ...] | None = None
    has_arm: bool = False  # it may reach out of the footprint: see `Gate.observe_posture`
    depth: DepthView | None = None  # None with `has_depth`: the camera exists but is not used yet


MOST_BEAMS = 20_000  # of one scan
CLOSE_ECHO_M = 0.1  # a sonar's echo at this distance or nearer often comes from the robot itself
