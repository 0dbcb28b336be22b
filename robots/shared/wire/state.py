"""The state of a robot and the view of its surroundings. Bridge to page, through the web process."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from robots.shared.records.verdict import Side, Way
from robots.shared.wire.base import Refusal, Role, Use, Worded
from robots.shared.wire.health import Health
from robots.shared.wire.navigation import Location
from robots.shared.wire.recordings import BlackBoxState, RecordingState
from robots.shared.wire.tasks import TaskStates

SILENT_S = 0.4  # without odometry for so long, people see the past; their pages have the same limit


class SpeedLimit(Worded, frozen=True, omit_defaults=True):
    """A speed limit for every request. It holds the robot back now if the verdict has its code and way."""

    code: str  # of the rule, a code of `Verdict`
    text: str  # "at most 0.3 m/s: no picture of the depth camera has come yet"
    mps: float
    way: Way | None = None  # direction of the limit; None: all directions


class Verdict(Worded, frozen=True, omit_defaults=True):
    """The gate's answer to the last command. docs/protocol.md lists the codes."""

    code: str  # "free", "idle", or the rule that holds the robot back
    text: str  # one line for the operator
    asked: tuple[float, float, float]  # vx, vy (m/s), w (rad/s)
    allowed: tuple[float, float, float]
    sensor: str | None = None
    distance_m: float | None = None  # gap between hull and obstacle
    bearing_rad: float | None = None  # of the obstacle, base frame
    side: Side | None = None
    point: tuple[float, float] | None = None
    limits: list[SpeedLimit] = []
    way: Way | None = None  # direction of the speed limit that holds the robot back, if one does


class Sensor(Worded, frozen=True):
    """State of a sensor. `age_s` None: never seen."""

    name: str
    kind: Literal["scan", "sonar", "odometry", "depth"]
    ok: bool
    age_s: float | None
    text: str = ""


class Odometry(Struct, frozen=True):
    """Pose in the odometry frame and speed in the base frame."""

    x: float
    y: float
    yaw: float
    vx: float
    vy: float
    w: float


class StopState(Struct, frozen=True):
    """The stop latch. `state`: "clear", "stopping" (zeros are sent), "stopped" (odometry shows standstill).

    `number` grows with every press. No number is used twice, also not after a restart of the bridge.
    """

    state: Literal["clear", "stopping", "stopped"]
    by: str | None = None
    reason: str = ""
    # from press to standstill by odometry; None also if the robot already stood
    standstill_ms: float | None = None
    number: int = 0
    was_standing: bool = False  # the robot stood at the press, and until standstill was confirmed


Part = Literal["base", "arm", "torso", "head", "gripper"]


class MovesAlthoughStopped(Worded, frozen=True):
    """A stopped robot moves: other software commands it past the console, somebody pushes it, or it rolls.

    The console cannot stop it: press the red button.
    """

    since_s: float  # since the console noticed it, after the robot's braking time
    parts: list[Part]  # that move
    speed_mps: float | None  # of the base, by odometry; None: odometry is silent, and nobody knows
    turn_radps: float | None
    # Nodes that publish velocities for the base, without the console's, by topic
    publishers: dict[str, list[str]]
    text: str  # the motion and its possible cause, in words


class Forgotten(Worded, frozen=True):
    """The last time at which the robot forgot what it had seen. `number` grows with each; a new bridge begins at 0.

    `code`: asked (a person asked for it), odometry_restarted (another publisher, or another run of the robot's
    master), stamps_back (the robot's clock was set back), jump (of the odometry's pose), bridge_started.
    """

    number: int
    code: str
    text: str
    ago_s: float


# waiting: no master. connecting: a master, but no odometry or drive topic yet. online: all is there. refused: the
# master does not have this bridge registered, or has another one.
Phase = Literal["waiting", "connecting", "online", "refused"]


class NeutralNeeded(Worded, frozen=True):
    """Why the stick must return to the middle before the robot moves; `text` continues a sentence that says so."""

    code: str  # see docs/protocol.md
    text: str


OverloadedPart = Literal["bridge", "console"]


class Overload(Struct, frozen=True):
    """The console's computer is overloaded: in the last five seconds this `part` woke up to `late_s` too late."""

    part: OverloadedPart
    late_s: float


class State(TaskStates, frozen=True, kw_only=True):
    """The state of the robot, as its bridge knows it."""

    SENTENCES = ("text", "navigation_held")

    phase: Phase
    text: str  # one line in words
    stop: StopState
    verdict: Verdict
    odometry: Odometry | None
    sensors: list[Sensor]
    battery_percent: float | None
    charging: bool | None
    holder: str | None
    fence: int | None
    seq: int | None  # of the newest drive message that arrived in order and in time
    neutral_needed: NeutralNeeded | None
    foreign: list[str]  # other nodes that publish to the drive topic
    watchers: list[str]  # names of viewers; `watchers_more` counts the rest
    clock_skew_s: float | None
    refused: dict[str, int]  # refused messages so far, by code
    latency_s: float = 0.0  # from a command to its effect in odometry, as the gate assumes
    latency_measured: bool = False  # False: it is the value of the profile
    # parts of the arm beyond the base: discs x, y, radius (base frame)
    arm: list[tuple[float, float, float]] = []
    watchers_more: int = 0
    location: Location | None = None  # None: not known
    overload: Overload | None = None
    unseen_s: float | None = None  # since the last odometry; None: none ever came
    # the watchdog is missing for 5 s or more: only the bridge can stop the robot
    watchdog_missing: bool = False
    health: Health | None = None  # None: no node of the robot reports its health
    stands: bool | None = None  # by odometry; None: odometry is silent, and nobody knows
    moves_although_stopped: MovesAlthoughStopped | None = None
    # at the consumption of the last half hour; None: not known, or on the charger
    battery_left_min: int | None = None
    forgotten: Forgotten | None = None
    head_follows: bool = False  # in this control, the head turned by itself to where the robot drives
    recording: RecordingState | None = None
    black_box: BlackBoxState | None = None  # None: nobody has control, or this bridge keeps no recordings


class MotionOffer(Struct, frozen=True):
    """A recorded motion of the robot, in the robot's own words."""

    name: str  # `motion` of `Play`
    title: str
    usage: str = ""  # its group
    description: str = ""
    duration_s: float | None = None


class UseOffer(Struct, frozen=True):
    """Default topic (or action) for one use of input, and the type that another topic must have."""

    topic: str
    type: str
    chooseable: dict[str, Role] = {}  # topics that may be chosen instead, each with the lowest role that may
    refusal: Refusal | None = None  # reason why the topic cannot be used now: no node on the robot reads it


class Offers(Worded, frozen=True, tag_field="t", tag="offers"):
    """The robot's capabilities. Sent at the start of a connection and on change."""

    SENTENCES = ("motions_text",)

    motions: list[MotionOffer] = []
    motions_text: str = ""  # reason why there is no motion
    languages: list[str] = []  # of its speech, BCP 47; the robot's default language first
    uses: dict[Use, UseOffer] = {}  # a robot that does not speak has no "speech"
    publishable: dict[str, str] = {}  # topics of the allow-list, with their types
    publishable_from: dict[str, Role] = {}  # the same topics, each with the lowest role that may publish


class Scan(Struct, frozen=True):
    """Points that sensors saw: current base frame, centimetres, flat [x0, y0, x1, y1, ...]."""

    laser_cm: list[int]
    sonar_cm: list[int | None]  # by index of RobotFacts.sonars; None: nothing in range
    depth_cm: list[int] = []
    remembered_cm: list[int] = []  # seen earlier; no sensor sees them now
    unseen: list[tuple[float, float]] = []  # sectors without laser, sonar: from, to (rad, counter-clockwise)
    heights_cm: list[int] = []  # of the points of `depth_cm`, while a page draws 3D: [low0, high0, ...]


class View(Struct, frozen=True, omit_defaults=True, tag_field="t", tag="view"):
    """The state and surroundings of the robot, for its viewers. The next view comes only after `Ack`."""

    state: State
    scan: Scan | None  # None: nothing to draw
    # positions (rad, m) of the description's joints, while a page draws the robot in 3D
    joints: dict[str, float] = {}
