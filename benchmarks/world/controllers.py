"""Controllers between stick and robot: our gate, two methods for comparison, and none."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.arm.discs import AT_HOME
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.sensing.depth import DepthImage, Lens, Transform, picture_of_image
from robots.bridge.gate.sensing.scan import Malformed
from robots.bridge.gate.values import LaserScan
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import SpeedLimit
from robots.simulator.sensors.depth import FOCAL_PX, WIDTH

Ranges = NDArray[np.float32]
Floats = NDArray[np.float64]
OPERATOR_DELAY_S = 0.05


class Fan(NamedTuple):
    """Geometry of a laser's beams: its pose in the base frame, first angle, increment and reach."""

    source: str
    pose: Pose
    angle_min: float
    increment: float
    nearest_m: float
    farthest_m: float


class Output(NamedTuple):
    """The published twist, the reason of its reduction, and the speed limits."""

    velocity: Velocity
    code: str = ""
    text: str = ""
    limits: tuple[SpeedLimit, ...] = ()


class Controller(Protocol):
    """A controller. Stamps are of the robot's clock, arrivals and `now_s` of the console's clock; seconds."""

    looks: bool  # whether it uses depth pictures, which are costly

    def odometry(self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity) -> None:
        """Process an odometry message."""

    def scan(self, stamp_s: float, arrival_s: float, ranges: Ranges) -> None:
        """Process a scan."""

    def sonar(self, frame: str, stamp_s: float, arrival_s: float, range_m: float) -> None:
        """Process a sonar's range."""

    def depth(self, stamp_s: float, arrival_s: float, metres: Ranges, to_base: Transform) -> None:
        """Process a depth picture; `to_base` is the transform from the camera's optical frame."""

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        """Return the twist to publish in place of `asked`, with its reason."""


class GateController:
    """The gate, used in the same way as in `robots.bridge.core.Core`."""

    looks = True

    def __init__(self, profile: GateProfile, fan: Fan) -> None:
        self.gate = Gate(profile)
        self.gate.observe_operator(OPERATOR_DELAY_S)
        self._profile = profile
        self._fan = fan
        self._neutral: Output | None = None  # why the stick must return to neutral first
        self.posture = AT_HOME  # as joint states report it
        self.pulls_again = True  # after a refused reverse, as a driver who has looked behind the robot
        self._lets_go = False  # before that

    def odometry(self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity) -> None:
        self.gate.observe_odometry(stamp_s, arrival_s, pose, velocity)

    def scan(self, stamp_s: float, arrival_s: float, ranges: Ranges) -> None:
        fan = self._fan
        self.gate.observe_scan(
            LaserScan(
                fan.source,
                stamp_s,
                arrival_s,
                ranges,
                fan.angle_min,
                fan.increment,
                fan.nearest_m,
                fan.farthest_m,
            )
        )

    def sonar(self, frame: str, stamp_s: float, arrival_s: float, range_m: float) -> None:
        self.gate.observe_range(frame, stamp_s, arrival_s, range_m, 1.0)

    def depth(self, stamp_s: float, arrival_s: float, metres: Ranges, to_base: Transform) -> None:
        view = self._profile.depth
        if view is None:
            return
        height, width = metres.shape
        focal = FOCAL_PX * width / WIDTH
        lens = Lens(focal, focal, width / 2.0, height / 2.0)
        image = DepthImage(width, height, "32FC1", False, 4 * width, metres.tobytes())
        try:
            frame = frame_of(picture_of_image(image, lens), to_base, view)
        except Malformed as error:
            self.gate.observe_bad_depth(str(error))
        else:
            self.gate.observe_depth(frame, stamp_s, arrival_s)

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        if asked == STILL:
            self._neutral = None
        self.gate.observe_posture(self.posture, now_s)
        verdict = self.gate.decide(STILL if self._neutral or self._lets_go else asked, sent, now_s)
        self._lets_go = self.pulls_again and verdict.code == "behind_unseen"
        output = Output(verdict.velocity, verdict.code, verdict.text, self.gate.limits(now_s))
        if verdict.neutral and not self._lets_go:
            self._neutral = output
        return output if self._neutral is None else self._neutral._replace(velocity=verdict.velocity)


class _LaserOnly:
    """Base of the compared methods: they use only the newest scan."""

    looks = False

    def __init__(self, fan: Fan) -> None:
        self._fan = fan
        self._angles: Floats = np.zeros(0)
        self._ranges: Ranges = np.zeros(0, dtype=np.float32)

    def odometry(self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity) -> None:
        """Not used."""

    def sonar(self, frame: str, stamp_s: float, arrival_s: float, range_m: float) -> None:
        """Not used."""

    def depth(self, stamp_s: float, arrival_s: float, metres: Ranges, to_base: Transform) -> None:
        """Not used."""

    def scan(self, stamp_s: float, arrival_s: float, ranges: Ranges) -> None:
        usable = np.isfinite(ranges)
        self._angles = np.asarray(self._fan.angle_min + self._fan.increment * np.flatnonzero(usable))
        self._ranges = ranges[usable]

    def points(self) -> Floats:
        """Return the points of the scan in the base frame at the time of the scan, (2, N)."""
        heading = self._angles + self._fan.pose.yaw
        return np.stack(
            (
                self._fan.pose.x + self._ranges * np.cos(heading),
                self._fan.pose.y + self._ranges * np.sin(heading),
            )
        )


class Cone(_LaserOnly):
    """Slows down by the nearest laser ray around the heading: linearly from 1.5 m to a stop at 0.25 m."""

    _HALF_ANGLE = math.radians(20.0)
    _FREE_M = 1.5
    _STOP_M = 0.25

    def __init__(self, fan: Fan, profile: GateProfile) -> None:
        super().__init__(fan)
        self._limits = profile.limits

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        heading = math.atan2(asked.w / self._limits.turn_radps, asked.vx / self._limits.forward_mps)
        near = self._ranges[np.abs(self._angles - heading) < self._HALF_ANGLE]
        nearest = float(near.min()) if near.size else math.inf
        share = min(max((nearest - self._STOP_M) / (self._FREE_M - self._STOP_M), 0.0), 1.0)
        return Output(Velocity(asked.vx * share, 0.0, asked.w), "cone", f"nearest {nearest:.2f} m")


class Monitor(_LaserOnly):
    """Polygons as in nav2's collision monitor: stop, slow down, and approach by time to collision."""

    _MIN_POINTS = 4
    _STOP_M = 0.05  # the stop polygon, and the slow-down polygon: the hull grown by this
    _SLOW_M = 0.35
    _SLOW_SHARE = 0.3
    _COLLISION_S = 2.0
    _STEP_S = 0.1

    def __init__(self, fan: Fan, profile: GateProfile) -> None:
        super().__init__(fan)
        self._radius_m = profile.radius_m or 0.0

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        points = self.points()
        distances = np.hypot(*points)
        if self._many(distances < self._radius_m + self._STOP_M):
            return Output(STILL, "stop")
        slow = self._SLOW_SHARE if self._many(distances < self._radius_m + self._SLOW_M) else 1.0
        approach = self._until_collision(points, asked) / self._COLLISION_S
        share = min(slow, approach)
        return Output(
            Velocity(asked.vx * share, 0.0, asked.w * share), "approach" if approach < slow else "slow"
        )

    def _many(self, inside: NDArray[np.bool_]) -> bool:
        return int(inside.sum()) >= self._MIN_POINTS

    def _until_collision(self, points: Floats, asked: Velocity) -> float:
        """Return the seconds at constant speed until points are in the hull; at most `_COLLISION_S`."""
        x = y = yaw = 0.0
        for step in range(round(self._COLLISION_S / self._STEP_S)):
            inside = np.hypot(points[0] - x, points[1] - y) < self._radius_m
            if self._many(inside):
                return step * self._STEP_S
            yaw += asked.w * self._STEP_S
            x += asked.vx * math.cos(yaw) * self._STEP_S
            y += asked.vx * math.sin(yaw) * self._STEP_S
        return self._COLLISION_S


class PassThrough(_LaserOnly):
    """Publishes every command unchanged."""

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        return Output(asked, "free")


CONTROLLERS: dict[str, Callable[[GateProfile, Fan], Controller]] = {
    "gate": lambda profile, fan: GateController(profile, fan),
    "cone": lambda profile, fan: Cone(fan, profile),
    "monitor": lambda profile, fan: Monitor(fan, profile),
    "none": lambda profile, fan: PassThrough(fan),
}
