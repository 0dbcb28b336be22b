"""Configuration of a bridge: plain values, no Django, no ROS.

The registry builds a `BridgeConfig` (`robots.registry.selectors.bridge_config`), the supervisor compares
their digests to notice edits.
Poses are (x, y, yaw) in the base frame, metres and radians.
"""

from __future__ import annotations

import hashlib
from typing import Literal

import msgspec
from msgspec import Struct

from robots.bridge.drive.input_filters import StickStep
from robots.bridge.gate.values import GateProfile
from robots.wire import ReverseSteering, Role, Use

CLOCK_SKEW_S = 0.5  # above it the robot's and the console's clocks disagree: that is told, and nothing else


class Topic(Struct, frozen=True):
    """A topic and its ROS type, such as ("/key_vel", "geometry_msgs/Twist")."""

    name: str
    type: str


class ScanSource(Struct, frozen=True):
    """A planar laser (sensor_msgs/LaserScan)."""

    topic: str
    pose: tuple[float, float, float]


class SonarSource(Struct, frozen=True):
    """A range sensor (sensor_msgs/Range); several may share a topic, told apart by frame_id."""

    topic: str
    frame_id: str
    pose: tuple[float, float, float]
    fov: float  # of its cone, radians
    max_range_m: float


class DepthSource(Struct, frozen=True):
    """A depth image or cloud of a camera that tf places above `base_frame`, which lies on the floor."""

    topic: str
    type: str
    info: str | None = None  # sensor_msgs/CameraInfo of the images; where it is silent, `fov` is taken
    fov: float = 1.1  # horizontal, radians
    base_frame: str = "base_footprint"
    every_s: float = 0.1  # pictures that come faster are left out
    height_m: float = 1.5  # of the robot, with everything that lifts at its lowest
    own_m: float = 0.05  # what is no farther than this from the footprint is the robot itself
    blind_m: float = 0.5  # along its axis; what is nearer it cannot measure


class HeadSource(Struct, frozen=True):
    """A head with two joints behind a joint trajectory controller (trajectory_msgs/JointTrajectory)."""

    topic: str
    pan_joint: str  # positive: left
    tilt_joint: str  # positive: up
    # radians: with it the depth camera shows the floor from 0.5 m to 3 m before the robot
    look_tilt: float = -0.6
    follows_turn: bool = False  # on a drive the head turns to where the robot will be


class ArmSource(Struct, frozen=True):
    """An arm that may reach out of the footprint. `Topics.joint_states` tells where it is."""

    home: dict[str, float]  # joints with which it is within the footprint: radians, or metres
    links: list[str]  # of the robot's description, shoulder to tip: the arm lies along their origins
    tolerance: float = 0.15  # of home: radians, or metres
    radius_m: float = 0.07
    reach_m: float = 0.9  # from the shoulder: what a motion sweeps whose points nobody knows
    # by motion, where there is no description: its end
    postures: dict[str, list[tuple[float, float, float]]] = {}


class Topics(Struct, frozen=True):
    """Where a robot's ROS interface is. None: the robot has no such thing."""

    drive: Topic  # geometry_msgs/Twist or geometry_msgs/TwistStamped
    odometry: Topic  # nav_msgs/Odometry
    scans: list[ScanSource] = []
    sonars: list[SonarSource] = []
    depth: DepthSource | None = None
    head: HeadSource | None = None
    arm: ArmSource | None = None
    joint_states: Topic | None = None
    battery: Topic | None = None  # std_msgs/Float32 percent, or sensor_msgs/BatteryState
    charging: Topic | None = None  # std_msgs/Bool
    speech: Topic | None = None
    languages: list[str] = []  # in which it speaks, BCP 47, its own first
    motions: Topic | None = None
    camera: Topic | None = None
    map: Topic | None = None  # nav_msgs/OccupancyGrid in the frame "map", latched
    cancel_on_stop: list[str] = []  # action names whose every goal an emergency stop cancels


What = Literal["choose", "publish", "call", "set"]


class Allowed(Struct, frozen=True):
    """One entry of the allow-list. Without an entry nobody may; `robots.bridge.tasks.denylist` forbids some entries."""

    what: What
    name: str  # of the topic, action, service or parameter
    type: str = ""
    use: Use | Literal[""] = ""  # of what is chosen
    role: Role = "operator"  # the lowest that may; the web process judges it


class LinkAddress(Struct, frozen=True):
    """Where the bridge listens: a Unix socket (owner only), or TCP with TLS and a shared secret."""

    unix_path: str | None = None
    host: str | None = None
    port: int | None = None
    certificate: str | None = None
    private_key: str | None = None
    secret: str | None = None
    authority: str | None = None  # certificates by which the web side knows the bridge; None: the system's


class BridgeConfig(Struct, frozen=True):
    """Everything one bridge needs."""

    robot_id: str  # UUID
    slug: str
    name: str
    master_uri: str
    advertised_address: str | None  # what the console calls itself to this robot (ROS_IP)
    host_aliases: dict[str, str]  # robot host name -> address (libnss-wrapper)
    topics: Topics
    gate: GateProfile
    reverse_steering: ReverseSteering
    link: LinkAddress
    state_dir: str  # lock, latch and fencing number
    allowed: tuple[Allowed, ...] = ()
    stick: tuple[StickStep, ...] = ()  # what stick positions pass on their way to the gate, in order
    run_dir: str | None = None  # where stops wait that nobody has confirmed (robots.stop.pending_stops)
    last_fence: int = 0  # highest number the database knows: with it a lost latch file shows

    def digest(self) -> str:
        """Differs when anything the bridge was told differs (the fencing number apart)."""
        told = msgspec.structs.replace(self, last_fence=0)
        return hashlib.sha256(msgspec.json.encode(told, order="deterministic")).hexdigest()
