"""Inputs, outputs and parameters of the gate (`Parameters`: its margins)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from msgspec import Struct

if TYPE_CHECKING:  # models of the console use profiles, too: they need no numpy
    import numpy as np
    from numpy.typing import NDArray


class Velocity(NamedTuple):
    """A planar twist in the base frame: m/s forward, m/s left, rad/s counter-clockwise."""

    vx: float
    vy: float
    w: float

    def scaled(self, share: float) -> Velocity:
        """Return the twist at this share of its speed, on the same arc."""
        return Velocity(*(share * axis + 0.0 for axis in self))  # + 0.0 makes -0.0 positive


STILL = Velocity(0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """A planar pose: metres, radians."""

    x: float
    y: float
    yaw: float


class LaserScan(NamedTuple):
    """An unchecked sensor_msgs/LaserScan: name of its laser, stamp, time of arrival; m, rad."""

    source: str
    stamp_s: float
    arrival_s: float
    ranges: Any
    angle_min: float
    angle_increment: float
    range_min_m: float
    range_max_m: float


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


CLOSE_ECHO_M = 0.1  # a sonar's echo at this distance or nearer often comes from the robot itself

# Sources of obstacles; a memory (of a laser, of the depth camera) holds earlier points that no sensor sees now.
Kind = Literal["scan", "sonar", "depth", "memory", "depth memory"]


class Obstacles(NamedTuple):
    """Points to avoid, current base frame. `points` (N, 2) float64; `source` (N,) index into `names`."""

    points: NDArray[np.float64]
    source: NDArray[np.intp]
    names: tuple[str, ...]
    kinds: tuple[Kind, ...]  # of the sources


# A sector around the base, counter-clockwise from the first bearing to the second, radians.
Sector = tuple[float, float]

# One eighth of the circle around the robot.
Side = Literal["ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"]

# bend: the way leaves the depth picture; turn: the corners of a turning base move to the sides
Way = Literal["forward", "left", "reverse", "right", "bend", "turn"]


class SpeedLimit(NamedTuple):
    """A limit on speed: a verdict's code, words, m/s. `way`: the only way that it limits; None: all."""

    code: str
    text: str
    mps: float
    way: Way | None = None


class Verdict(NamedTuple):
    """The allowed twist, and the reason if it is less than asked.

    `code`: "idle" (nothing asked), "free", or the rule that reduces the twist. `way`: as in `SpeedLimit`, if
    a speed limit reduces it. `limits`: limits for every command; `Gate.decide` leaves them empty,
    `Gate.limits` returns them. `neutral`: after this stop (stale or missing data) the stick must return to
    neutral.
    """

    velocity: Velocity
    asked: Velocity
    code: str
    text: str
    sensor: str | None = None
    distance_m: float | None = None
    bearing_rad: float | None = None  # of the obstacle, base frame
    side: Side | None = None
    point: tuple[float, float] | None = None
    limits: tuple[SpeedLimit, ...] = ()
    neutral: bool = False
    way: Way | None = None


# Why memory was dropped: a person asked; another publisher of the odometry, or another run of the robot's master; its
# stamps went back; its pose jumped; the bridge was started, so the gate is new.
ForgetCode = Literal["asked", "odometry_restarted", "stamps_back", "jump", "bridge_started"]


class Forgotten(NamedTuple):
    """An event in which the gate dropped what it remembered; `number` grows with each."""

    number: int
    code: ForgetCode


BRIDGE_STARTED = Forgotten(0, "bridge_started")


class SensorHealth(NamedTuple):
    """State of a sensor. `age_s` None: no message yet. `text` is empty while `ok`."""

    name: str
    kind: Literal["scan", "sonar", "odometry", "depth"]
    ok: bool
    age_s: float | None
    text: str
