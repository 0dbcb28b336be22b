"""Data of the simulated robots: hull, sensors, topics. Base frame, metres, radians.

The figures of TIAGo and PMB-2 are PAL's; the generic robots are those of the profiles with the same names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from robots.simulator.physics.base import TIAGO as TIAGO_LIMITS
from robots.simulator.physics.base import BaseLimits


@dataclass(frozen=True)
class Part:
    """An upright piece of the hull: a cylinder of `radius`, or a block of half extents `half`."""

    name: str
    at: tuple[float, float]
    bottom: float
    top: float
    radius: float = 0.0
    half: tuple[float, float] | None = None


@dataclass(frozen=True)
class LaserMount:
    """A planar laser: pose (x, y, z, yaw) and field of view."""

    frame: str = "base_laser_link"
    pose: tuple[float, float, float, float] = (0.202, 0.0, 0.0945, 0.0)
    half_angle: float = math.radians(110.0)
    rays: int = 666
    shortest_m: float = 0.05
    longest_m: float = 25.0
    sigma_m: float = 0.01
    dropout_share: float = 0.004


@dataclass(frozen=True)
class SonarMount:
    """A sonar: frame, pose (x, y, z, yaw), cone and reach."""

    frame: str
    pose: tuple[float, float, float, float]
    fov: float = 0.5
    shortest_m: float = 0.02
    longest_m: float = 1.0
    sigma_m: float = 0.005
    lost_share: float = 0.0  # share of echoes that are lost


@dataclass(frozen=True)
class CameraMount:
    """A fixed colour camera: frame of its body, pose (x, y, z, yaw, pitch). A positive pitch looks down."""

    link: str
    pose: tuple[float, float, float, float, float]

    @property
    def optical_frame(self) -> str:
        """The frame of the camera's pictures."""
        return f"{self.link.removesuffix('_link')}_optical_frame"


@dataclass(frozen=True)
class WheelBase:
    """Two driven wheels."""

    radius_m: float
    separation_m: float


@dataclass(frozen=True)
class Names:
    """Names of a base's topics. `mux`: TIAGo's velocity inputs and locks come before `command`."""

    command: str = "/mobile_base_controller/cmd_vel"
    odometry: str = "/mobile_base_controller/odom"
    base_frame: str = "base_footprint"
    scan: str = "/scan_raw"
    filtered_scan: str | None = "/scan"
    mux: bool = True


@dataclass(frozen=True)
class Body:
    """One kind of robot."""

    mass_kg: float
    parts: tuple[Part, ...]
    limits: BaseLimits
    names: Names = Names()
    laser: LaserMount = field(default_factory=LaserMount)
    sonars: tuple[SonarMount, ...] = ()
    wheels: WheelBase | None = None  # those in /joint_states
    rear_camera: CameraMount | None = None
    upper_body: bool = False  # torso, head, arm: joints, camera, speech and motions


_SONARS = (
    SonarMount("base_sonar_01_link", (-0.183, -0.183, 0.2715, math.radians(225.0))),
    SonarMount("base_sonar_02_link", (-0.259, 0.0, 0.2715, math.radians(180.0))),
    SonarMount("base_sonar_03_link", (-0.183, 0.183, 0.2715, math.radians(135.0))),
)
REAR_CAMERA = CameraMount("rear_camera_link", (-0.25, 0.0, 0.85, math.pi, math.radians(25.0)))
_PMB2_WHEELS = WheelBase(radius_m=0.0985, separation_m=0.4044)
_PMB2_BASE = Part("base", (0.0, 0.0), 0.0, 0.30, radius=0.27)
_GENERIC_NAMES = Names("/cmd_vel", "/odom", "base_link", "/scan", filtered_scan=None, mux=False)
_CENTRE_LASER = LaserMount(frame="laser", pose=(0.0, 0.0, 0.2, 0.0), half_angle=math.pi, rays=720)

TIAGO = Body(
    mass_kg=70.0,
    # With the arm folded (`joints.arm`), all parts stay within the base's circle; table tops can still hit them.
    parts=(
        _PMB2_BASE,
        Part("torso", (-0.06, 0.0), 0.30, 1.0, radius=0.19),
        Part("head", (0.06, 0.0), 1.0, 1.15, radius=0.13),
    ),
    limits=TIAGO_LIMITS,
    sonars=_SONARS,
    wheels=_PMB2_WHEELS,
    upper_body=True,
)

PMB2 = Body(mass_kg=40.0, parts=(_PMB2_BASE,), limits=TIAGO_LIMITS, sonars=_SONARS, wheels=_PMB2_WHEELS)

GENERIC_DIFF = Body(
    mass_kg=30.0,
    parts=(Part("base", (0.0, 0.0), 0.0, 0.25, radius=0.35),),
    limits=BaseLimits(0.6, 0.2, 0.0, 1.5, linear_mps2=0.5, angular_radps2=1.5),
    names=_GENERIC_NAMES,
    laser=_CENTRE_LASER,
)

GENERIC_OMNI = Body(
    mass_kg=30.0,
    parts=(Part("base", (0.0, 0.0), 0.0, 0.25, half=(0.35, 0.28)),),
    limits=BaseLimits(0.6, 0.3, 0.3, 1.2, linear_mps2=0.5, angular_radps2=1.2),
    names=_GENERIC_NAMES,
    laser=_CENTRE_LASER,
)

BODIES: dict[str, Body] = {
    "tiago": TIAGO,
    "pmb2": PMB2,
    "generic_diff": GENERIC_DIFF,
    "generic_omni": GENERIC_OMNI,
}
