"""What no allow-list admits, whoever asks: what would go around the chain, or blind it. Pure.

Names are judged word by word (/power/is_emergency: power, is, emergency), so that a name space or a number does not
hide what a topic is. Types are judged too, for a robot may call its topics what it likes. Too much is refused rather
than too little.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from robots.bridge.config import Allowed, Topic, Topics

USE_TYPES = {
    "drive": ("geometry_msgs/Twist", "geometry_msgs/TwistStamped"),
    "speech": ("pal_interaction_msgs/TtsAction", "std_msgs/String", "sound_play/SoundRequest"),
    "motions": ("play_motion_msgs/PlayMotionAction",),
}

_VELOCITY = "velocities move the base: they go through the gate only"

# Why not, and the words in a name that mean it. Those of five letters or more are found inside others, too.
# What is chosen for driving has passed the gate, so that only the first group keeps it away.
_OVERRIDING = {
    "controllers, and what configures them, take commands past the gate": "control command trajectory mux reconfigure "
    "parameter",
    "the lab's own joystick wins over the console, and must": "joy joystick joypad gamepad teleop tab",
    "locks and emergency stops are the robot's own": "lock locks locked pause brake stop estop emergency "
    "closing_loop safety deadman",
    "what the console calls its own is its own": "fleet_bridge fleet_inspector",
}
_CHAIN = {
    _VELOCITY: "vel velocity velocities cmdvel twist speed",
    "what turns wheels and motors goes past the gate": "cmd wheel motor servo",
    "goals and cancels of actions go through the console's own orders": "goal cancel",
    "the gate sees by scans and ranges": "scan scans laser lidar hokuyo sick sonar range ultrasound bumper cliff",
    "the gate sees by depth pictures and clouds": "depth points cloud disparity xtion realsense",
    "the gate reckons with odometry": "odom odometry",
    "the gate reckons with where the joints are": "joint",
    "frames and clocks tie together what the gate sees": "tf clock time robot_description",
    "the robot's power is its own": "power battery batteries charging charge docked shutdown reboot",
}

_POINTS = {"what a motion sweeps is judged by its points": "play_motion"}

_SENT_TYPES = {
    _VELOCITY: r"geometry_msgs/(Accel|Wrench).*|ackermann_msgs/.*|.*/(Twist|Velocity|CmdVel)\w*",
    "controllers take commands past the gate": r"(trajectory_msgs|control_msgs|controller_manager_msgs)/.*|"
    r".*/\w*JointTrajectory\w*",
    "goals, cancels and what answers them go through the console's own orders": r"actionlib_msgs/.*|"
    r".*/\w+Action(Goal|Result|Feedback)?",
    "joysticks win over the console, and must": r".*/Joy\w*",
    "the gate sees by scans and ranges": r"sensor_msgs/(LaserScan|MultiEchoLaserScan|LaserEcho|Range)|.*/\w*Bumper\w*",
    "the gate sees by depth pictures and clouds": r"sensor_msgs/(PointCloud2?|Image|CompressedImage|CameraInfo)|"
    r"stereo_msgs/.*|theora_image_transport/.*",
    "the gate reckons with odometry": r"nav_msgs/Odometry",
    "the gate reckons with where the joints are": r"sensor_msgs/(Multi\w*)?JointState",
    "frames and clocks tie together what the gate sees": r"(tf|tf2_msgs)/.*|geometry_msgs/TransformStamped|"
    r"rosgraph_msgs/Clock",
    "the robot's power is its own": r"sensor_msgs/BatteryState",
    "what is spoken goes through the console's own orders": r"sound_play/.*",
}
_CALLED_TYPES = {
    "controllers and what configures them take commands past the gate": r"(controller_manager_msgs|dynamic_reconfigure|"
    r"topic_tools|nodelet)/.*",
}


def why_never(what: str, name: str, type: str, topics: Topics, use: str = "") -> str | None:
    """Why no allow-list of this robot admits it, in words; None if one may.

    `what`: choose (input of `use` goes there), publish, call, set. `type` "" where it is not known.
    """
    if what == "choose":
        return _why_never_chosen(name, type, topics, use)
    return next(_reasons(what, name, type, topics), None)


def admissible(allowed: Iterable[Allowed], topics: Topics) -> tuple[Allowed, ...]:
    """Those entries of an allow-list that may be on it."""
    return tuple(
        entry for entry in allowed if why_never(entry.what, entry.name, entry.type, topics, entry.use) is None
    )


def _why_never_chosen(name: str, type: str, topics: Topics, use: str) -> str | None:
    """What is chosen takes input that has passed the chain, but must not win over a person's joystick or a lock."""
    default: Topic | None = getattr(topics, use) if use in USE_TYPES else None
    if default is None:
        return f"this robot has nothing that takes input for {use or 'no use'}"
    if type != default.type:
        return f"its type is {type or 'not told'}, and input for {use} is {default.type}"
    if name != default.name and name in _own(topics):
        return "the robot uses it for something else"
    return next(_by_name(name, _OVERRIDING if use == "drive" else _OVERRIDING | _CHAIN), None)


def _reasons(what: str, name: str, type: str, topics: Topics) -> Iterator[str]:
    if name in _own(topics):
        yield "the console itself works with it"
    yield from _by_name(name, _OVERRIDING | _CHAIN | ({} if what == "call" else _POINTS))
    yield from _by_type(type, _SENT_TYPES if what == "publish" else _CALLED_TYPES)


def _own(topics: Topics) -> set[str | None]:
    """Every topic and action that the robot's description names."""
    names: set[str | None] = set(topics.cancel_on_stop)
    for field in topics.__struct_fields__:
        told = getattr(topics, field)
        for source in told if isinstance(told, list) else [told]:
            names |= {getattr(source, part, None) for part in ("name", "topic", "info")}
    return names


def _by_name(name: str, groups: dict[str, str]) -> Iterator[str]:
    words = _words(name)
    for why, meant in groups.items():
        if any((word if len(word) >= 5 else f"_{word}_") in words for word in meant.split()):
            yield why


def _words(name: str) -> str:
    """/tiago/scanRaw2 -> _tiago_scan_raw_"""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    return f"_{'_'.join(re.findall('[a-z]+', apart))}_"


def _by_type(type: str, groups: dict[str, str]) -> Iterator[str]:
    return (why for why, meant in groups.items() if re.fullmatch(meant, type))
