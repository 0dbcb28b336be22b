"""The values that the gate takes and gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from msgspec import Struct

if TYPE_CHECKING:  # the web process knows profiles too, and need not carry numpy
    import numpy as np
    from numpy.typing import NDArray


class Velocity(NamedTuple):
    """A planar twist in the base frame: m/s forward, m/s left, rad/s counter-clockwise."""

    vx: float
    vy: float
    w: float

    def scaled(self, share: float) -> Velocity:
        """The same curve, at this share of the speed."""
        return Velocity(*(share * axis + 0.0 for axis in self))  # a zero has no sign


STILL = Velocity(0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """A planar pose: metres, radians."""

    x: float
    y: float
    yaw: float


class LaserScan(NamedTuple):
    """A sensor_msgs/LaserScan as it came, unchecked: which laser's, its stamp, when it arrived; m, rad."""

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
    latency_s: float = 0.20  # T, until it is measured
    latency_spare_s: float = 0.1  # that T may grow by from one moment to the next: always reckoned with
    operator_delay_s: float = 0.30  # to the page and back; a longer one limits speed
    creep_mps: float = 0.10  # v_creep
    near_miss_s: float = 0.08  # c_lat
    between_sonars_mps: float = 0.10  # where sonars alone look: between and above them nobody does


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

    height_m: float  # of the robot, with everything that lifts at its lowest
    own_m: float = 0.05  # what is no farther than this from the footprint is the robot itself
    blind_m: float = 0.5  # along its axis; what is nearer it cannot measure


class GateProfile(Struct, frozen=True):
    """The gate's configuration of a robot.

    The footprint, in the base frame, is the first of these that is given: `discs` (x, y, radius), whose union it is;
    `outline`, convex and counter-clockwise; a disc of `radius_m` about the origin.
    `scan_poses` and `sonar_poses` map a source's name (scan topic, sonar frame_id) to its pose.
    """

    limits: Limits
    radius_m: float | None
    outline: tuple[tuple[float, float], ...] | None
    scan_poses: dict[str, tuple[float, float, float]]
    sonar_poses: dict[str, tuple[float, float, float]]
    sonar_fov: dict[str, float]
    has_depth: bool
    blind_mps: float  # speed in directions, or heights, that nobody watches
    parameters: Parameters = Parameters()
    discs: tuple[tuple[float, float, float], ...] | None = None
    has_arm: bool = False  # which may reach out of the footprint: `Gate.observe_posture` tells
    depth: DepthView | None = None  # None with `has_depth`: there is one, and it is not used


# Sources of obstacles; a memory (of a laser, of the depth camera) holds earlier points that no sensor sees now.
Kind = Literal["scan", "sonar", "depth", "memory", "depth memory"]


class Obstacles(NamedTuple):
    """Points to keep clear of, base frame of now. `points` (N, 2) float64; `source` (N,) index into `names`."""

    points: NDArray[np.float64]
    source: NDArray[np.intp]
    names: tuple[str, ...]
    kinds: tuple[Kind, ...]  # of the sources


# A part of the way round the base, counter-clockwise from the first bearing to the second, radians.
Sector = tuple[float, float]

# The eighth of the compass round the robot.
Side = Literal["ahead", "ahead left", "left", "behind left", "behind", "behind right", "right", "ahead right"]

# bend: out of what is seen; turn: of corners
Way = Literal["forward", "left", "reverse", "right", "bend", "turn"]


class SpeedLimit(NamedTuple):
    """A limit on speed: a verdict's code, words, m/s. `way`: the one that it holds for; None: for all."""

    code: str
    text: str
    mps: float
    way: Way | None = None


class Verdict(NamedTuple):
    """The allowed twist, and the reason if it is less than asked.

    `code`: "idle" (nothing asked), "free", or the rule that holds back; `way` as in `SpeedLimit`, if one holds back.
    `limits` hold whatever is asked; `Gate.decide` leaves them out, `Gate.limits` returns them. `neutral`: this stop is
    of the kind after which the stick must return to neutral (stale or missing data).
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


class SensorHealth(NamedTuple):
    """How a sensor is. `age_s` None: never seen. `text` is empty while `ok`."""

    name: str
    kind: Literal["scan", "sonar", "odometry", "depth"]
    ok: bool
    age_s: float | None
    text: str
