"""Configuration of one bridge: plain values, no Django, no ROS.

The registry builds a `BridgeConfig` (`robots.registry.selectors.bridge_config`); the supervisor compares digests to
notice edits. Poses are (x, y, yaw) in the base frame, in metres and radians.
"""

from __future__ import annotations

import hashlib
from typing import Literal

import msgspec
from msgspec import Struct

from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.configuration.input_filters import StickStep
from robots.shared.configuration.robot_ros import Ros, RosVersion
from robots.shared.messages.type_names import in_ros2, is_action
from robots.shared.wire import TASK_KINDS, Limb, ReverseSteering, Role, Use

# A larger difference of the robot's and the console's clocks is reported, and velocities have no stamp then.
CLOCK_SKEW_S = 0.5


class Topic(Struct, frozen=True):
    """A topic and its ROS type, such as ("/key_vel", "geometry_msgs/Twist"), as the robot's ROS writes it.

    `others`: what other versions of the robot's software have in its place.
    """

    name: str
    type: str
    others: tuple[Topic, ...] = ()

    @property
    def is_action(self) -> bool:
        """Whether this is an action: its topics and services begin with its name."""
        return is_action(self.type)


class ScanSource(Struct, frozen=True):
    """A planar laser (sensor_msgs/LaserScan)."""

    topic: str
    pose: tuple[float, float, float]


class SonarSource(Struct, frozen=True):
    """A range sensor (sensor_msgs/Range). Sensors may share a topic; frame_id tells them apart."""

    topic: str
    frame_id: str
    pose: tuple[float, float, float]
    fov: float  # opening angle of the cone, radians
    max_range_m: float


class DepthSource(Struct, frozen=True):
    """A depth image or cloud of a camera. tf gives its pose above `base_frame`, which lies on the floor."""

    topic: str
    type: str
    info: str | None = None  # sensor_msgs/CameraInfo of the images; without messages there, `fov` is used
    fov: float = 1.1  # horizontal, radians
    base_frame: str = "base_footprint"
    every_s: float = 0.1  # frames that arrive faster are skipped
    height_m: float = 1.5  # the robot's height, with all lifting parts at their lowest
    own_m: float = 0.05  # points within this distance of the footprint are the robot itself
    blind_m: float = 0.5  # along its axis: it cannot measure nearer points


class CameraSource(Struct, frozen=True):
    """A camera for people. Addresses and messages contain `name`; pages show `label`, or else the name."""

    name: str
    topic: str
    type: str  # sensor_msgs/CompressedImage or sensor_msgs/Image
    info: str | None = None  # sensor_msgs/CameraInfo: without it no path is drawn into the picture
    frame: str | None = None  # the camera's optical frame; None: use the frame of its messages
    label: str = ""
    moves: bool = False  # the camera is mounted on the head
    base_frame: str = "base_footprint"  # on the floor


POINT_HEAD, POINT_HEAD_2 = "control_msgs/PointHeadAction", "control_msgs/action/PointHead"


class HeadSource(Struct, frozen=True):
    """A head with two joints behind a joint trajectory controller (trajectory_msgs/JointTrajectory).

    `point_head`: name of its action (control_msgs/PointHead), which is used in place of the controller while a
    server listens to it. A stop cancels its goals.
    """

    topic: str
    pan_joint: str  # positive: left
    tilt_joint: str  # positive: up
    # radians: at this tilt the depth camera sees the floor from 0.5 m to 3 m in front of the robot
    look_tilt: float = -0.6
    pan_rad: tuple[float, float] = (-1.3, 1.3)  # rightmost and leftmost position
    tilt_rad: tuple[float, float] = (-1.0, 0.7)  # lowest and highest position
    follows_turn: bool = False  # while driving, the head turns to where the robot will be
    point_head: str | None = None
    base_frame: str = "base_footprint"  # frame of the directions that `point_head` gets


class ArmSource(Struct, frozen=True):
    """An arm that may reach out of the footprint. `Topics.joint_states` gives its position."""

    home: dict[str, float]  # joint positions with the arm inside the footprint: radians, or metres
    links: list[str]  # in the description, from shoulder to tip: the lines between their origins are the arm
    tolerance: float = 0.15  # tolerance of `home`: radians, or metres
    radius_m: float = 0.07
    reach_m: float = 0.9  # from the shoulder: a motion whose points are unknown needs all this space
    # end posture of each motion, used if there is no description
    postures: dict[str, list[tuple[float, float, float]]] = {}


TRAJECTORY, GRIPPER_COMMAND = "control_msgs/FollowJointTrajectoryAction", "control_msgs/GripperCommandAction"
TRAJECTORY_2 = "control_msgs/action/FollowJointTrajectory"
GRIPPER_COMMAND_2 = "control_msgs/action/GripperCommand"


class LimbSource(Struct, frozen=True):
    """A limb that people move by one number: joints behind an action, all moved by the same amount.

    The number is the sum of the joints' positions: the distance of two fingers, or the height of a torso. It is also
    the position that a goal of a gripper's own controller names (`is_command`).
    """

    action: str  # such as /gripper_controller/follow_joint_trajectory
    joints: list[str]  # `Topics.joint_states` gives their positions
    range_m: tuple[float, float]  # of each joint
    speed_mps: float  # of each joint
    type: str = TRAJECTORY  # or, for a gripper, `GRIPPER_COMMAND`; with ROS 2 the same in its words
    effort_n: float | None = None  # most effort of `GRIPPER_COMMAND`; the controller defines the meaning of 0

    @property
    def is_command(self) -> bool:
        """Whether goals are those of a gripper's own controller: a position and an effort."""
        return self.type in (GRIPPER_COMMAND, GRIPPER_COMMAND_2)


class NavigationSource(Struct, frozen=True):
    """The robot's own navigation.

    Its velocity topic has a lower priority than `Topics.drive`, so that the bridge can take over. It also
    needs `Topics.map` and a transform from `frame` to the odometry frame.
    """

    action: str  # such as /move_base
    velocity: str  # topic by which it drives the base, geometry_msgs/Twist
    pose: str  # topic of localisation, geometry_msgs/PoseWithCovarianceStamped
    type: str = "move_base_msgs/MoveBaseAction"
    plan: str | None = None  # the path that it plans, nav_msgs/Path
    set_pose: str | None = None  # takes a pose from people, geometry_msgs/PoseWithCovarianceStamped
    frame: str = "map"


# The types that are understood, by field of `Topics`
_TYPES: dict[str, tuple[str, ...]] = {
    "drive": ("geometry_msgs/Twist", "geometry_msgs/TwistStamped"),
    "speech": ("pal_interaction_msgs/TtsAction", "std_msgs/String", "sound_play/SoundRequest"),
    "motions": ("play_motion_msgs/PlayMotionAction",),
    "odometry": ("nav_msgs/Odometry",),
    "depth": ("sensor_msgs/Image", "sensor_msgs/PointCloud2"),
    "joint_states": ("sensor_msgs/JointState",),
    "battery": ("std_msgs/Float32", "sensor_msgs/BatteryState"),  # a Float32 in percent
    "charging": ("std_msgs/Bool",),
    "diagnostics": ("diagnostic_msgs/DiagnosticArray",),
    "map": ("nav_msgs/OccupancyGrid",),  # in the frame "map", latched
}
_TYPES_2 = {
    "speech": ("tts_msgs/action/TTS", "communication_skills/action/Say"),
    "motions": ("play_motion2_msgs/action/PlayMotion2",),
}
TOPIC_TYPES: dict[RosVersion, dict[str, tuple[str, ...]]] = {
    1: _TYPES,
    2: {field: tuple(map(in_ros2, types)) for field, types in _TYPES.items()} | _TYPES_2,
}


def drive_topic(name: str, kind: str, ros: RosVersion) -> Topic:
    """Return the topic for velocities. With ROS 2 they have a stamp or none, as its listeners have it."""
    kinds = TOPIC_TYPES[2]["drive"] if ros == 2 else ()
    return Topic(name, kind, tuple(Topic(name, other) for other in kinds if other != kind))


class Topics(Struct, frozen=True):
    """The robot's ROS interface. None: the robot has no such topic."""

    drive: Topic
    odometry: Topic
    scans: list[ScanSource] = []
    sonars: list[SonarSource] = []
    depth: DepthSource | None = None
    head: HeadSource | None = None
    arm: ArmSource | None = None
    joint_states: Topic | None = None
    battery: Topic | None = None
    charging: Topic | None = None
    diagnostics: Topic | None = None
    speech: Topic | None = None
    languages: list[str] = []  # spoken languages, BCP 47, the default first
    motions: Topic | None = None
    cameras: list[CameraSource] = []
    map: Topic | None = None
    navigation: NavigationSource | None = None
    gripper: LimbSource | None = None
    torso: LimbSource | None = None
    cancel_on_stop: list[str] = []  # names of actions; an emergency stop cancels all their goals

    @property
    def limbs(self) -> dict[Limb, LimbSource]:
        """The limbs that people can move."""
        both: dict[Limb, LimbSource | None] = {"gripper": self.gripper, "torso": self.torso}
        return {limb: source for limb, source in both.items() if source is not None}

    @property
    def cancelled(self) -> list[str]:
        """Names of all actions whose goals an emergency stop cancels: also those of tasks (`TaskKind`)."""
        others = [self._action(path) for kind in TASK_KINDS for path in kind.stopped_actions]
        others += [one.name for one in (self.speech.others if self.speech else ()) if one.is_action]
        return [*self.cancel_on_stop, *(name for name in others if name and name not in self.cancel_on_stop)]

    def _action(self, path: str) -> str | None:
        """Return the action that a path of fields leads to, such as "navigation.action"."""
        capability, field = path.split(".")
        source = getattr(self, capability)
        action: str | None = getattr(source, field) if source is not None else None
        return action


What = Literal["choose", "publish", "call", "set"]
# Prefix of services and actions that clients of the console offer each other; they never reach the robot
CLIENTS = "/fleet/clients/"


class Allowed(Struct, frozen=True):
    """One entry of the allow-list. Anything without an entry is forbidden.

    `robots.shared.configuration.denylist` forbids some entries.
    """

    what: What
    name: str  # of a topic, action, service or parameter
    type: str = ""
    use: Use | Literal[""] = ""  # for "choose": the use of the topic
    role: Role = "operator"  # the lowest role that may do this; the web process checks it


class LinkAddress(Struct, frozen=True):
    """Where the bridge listens: on a Unix socket (owner only), and, with a host, by TCP with TLS and a shared secret.

    A web process on the bridge's computer uses the Unix socket, others the host and port.
    """

    unix_path: str | None = None
    host: str | None = None
    port: int | None = None
    certificate: str | None = None
    private_key: str | None = None
    secret: str | None = None
    # CA certificates with which the web side checks the bridge; None: the system's
    authority: str | None = None


class RecordingPlace(Struct, frozen=True):
    """Where the bridge's computer keeps recordings, of all its robots."""

    directory: str
    quota_bytes: int  # of all files there
    least_free_bytes: int  # left on the disk for everything else
    version: str = ""  # of the console, for the files


class BridgeConfig(Struct, frozen=True):
    """The whole configuration of one bridge."""

    robot_id: str  # UUID
    slug: str
    name: str
    ros: Ros
    topics: Topics
    gate: GateProfile
    reverse_steering: ReverseSteering
    link: LinkAddress
    state_dir: str  # folder of lock, stop latch and fence
    allowed: tuple[Allowed, ...] = ()
    stick: tuple[StickStep, ...] = ()  # input filters in order, from stick position to gate
    run_dir: str | None = None  # folder of pending stops (robots.shared.link.pending_stops)
    recordings: RecordingPlace | None = None  # None: no black box, no recordings
    last_fence: int = 0  # highest fence in the database: shows that a state file is lost

    def digest(self) -> str:
        """Return a hash of the configuration without the fence. It differs when any setting differs."""
        settings = msgspec.structs.replace(self, last_fence=0)
        return hashlib.sha256(msgspec.json.encode(settings, order="deterministic")).hexdigest()
