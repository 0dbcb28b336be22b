"""Controllers between stick and robot: our gate, and none."""

from __future__ import annotations

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


class PassThrough:
    """Publishes every command unchanged."""

    looks = False

    def ignore(self, *_message: object) -> None:
        """Use no sensor."""

    odometry = scan = sonar = depth = ignore

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Output:
        return Output(asked, "free")


CONTROLLERS: dict[str, Callable[[GateProfile, Fan], Controller]] = {
    "gate": GateController,
    "none": lambda _profile, _fan: PassThrough(),
}
