"""Deny entries that no allow-list may contain: they bypass the safety chain or disturb its sensors. Pure.

Names are checked word by word (/power/is_emergency: power, is, emergency), so that a namespace or a number
does not hide the purpose of a topic. Types are checked as well, because a robot may use any topic name. In
doubt, deny.

The registry refuses a denied entry. `admissible` leaves such entries out when the registry, `holder_tasks.py` or the
inspector takes a configuration. `topics/inspector/requests.py` checks each message, call and parameter.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import get_args

from robots.shared.configuration.bridge_config import Allowed, Topic, Topics
from robots.shared.messages.type_names import bare
from robots.shared.sentences import Sentence, say
from robots.shared.wire import Field, Use

# names that ROS does not change when it resolves them
FULL_NAME = re.compile(r"/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*")
PARAMETER = re.compile(rf"{FULL_NAME.pattern}(:[A-Za-z0-9_./-]+)?")  # in ROS 2 of a node: /node:parameter

_VELOCITY = say("velocities move the base: they go through the gate only")

# Parts of names, by reason. A part matches anywhere in a name; an underscore means the begin or end of a
# word. For a topic chosen for driving, only the first group applies: its input has passed the gate.
_OVERRIDING = {
    say("controllers and their configuration bypass the gate"): "control command trajectory mux "
    "reconfigure param rosapi nodelet bond _script urscript setpoint _pid_",
    say("the lab’s joystick must override the console"): "_joy joystick joypad gamepad teleop _tab_ _tabs_",
    say(
        "locks and emergency stops belong to the robot"
    ): "_lock locks locked unlock interlock pause brake breaker "
    "stop halt emergency closing_loop safety deadman collision",
    say("the console’s own nodes and topics are reserved"): "fleet_bridge fleet_inspector "
    "fleet_camera fleet_tap fleet_recorder fleet_watchdog fleet_check",
}
_CHAIN = {
    _VELOCITY: "_vel_ _vels_ velocit cmdvel basevel twist speed _drive_ steer throttle gazebo",
    say("commands to wheels and motors bypass the gate"): "cmd wheel motor servo effort torque _pwm_ _jog",
    say("goals and cancels of actions go through the console’s tasks"): "goal cancel",
    say("the gate uses scans and ranges"): "scan laser lidar hokuyo _sick_ sonar range ultraso bumper cliff",
    say(
        "the gate uses depth images and clouds"
    ): "depth points cloud disparity camera xtion realsense kinect astra",
    say("the gate uses odometry"): "odom encoder _imu gyro _ekf_ _ukf_ set_pose _reset_",
    say("the gate uses joint positions"): "joint",
    say("the gate uses frames and clocks"): "_tf clock _time_ robot_description robot_state_publisher",
    say("power and docking belong to the robot"): "power battery batteries charg dock shutdown reboot",
}

_POINTS = {say("the points of a motion decide about the arm’s space"): "play_motion"}

_SENT_TYPES = {
    _VELOCITY: r"geometry_msgs/(Accel|Wrench).*|(ackermann|gazebo)_msgs/.*|.*/\w*(Twist|Velocit|CmdVel|Speed)\w*",
    say("controllers bypass the gate"): r"(trajectory_msgs|control_msgs|controller_manager_msgs|bond)/.*|"
    r".*/\w*JointTrajectory\w*",
    say("goals, cancels and their answers go through the console’s tasks"): r"action(lib)?_msgs/.*|"
    r".*/\w+Action(Goal|Result|Feedback)?|.*/action/.*",
    say("joysticks must override the console"): r".*/\w*Joy\w*",
    say("the gate uses scans and ranges"): r".*/\w*(LaserScan|LaserEcho|Bumper)\w*|.*/Range",
    say("the gate uses depth images and clouds"): r".*/\w*(PointCloud|Image|CameraInfo)\w*|"
    r"(stereo_msgs|theora_image_transport)/.*",
    say("the gate uses odometry"): r".*/\w*Odom\w*|.*/Imu",
    say("the gate uses joint positions"): r".*/\w*JointState\w*",
    say("the gate uses frames and clocks"): r"(tf|tf2_msgs)/.*|.*/TransformStamped|rosgraph_msgs/Clock",
    say("power belongs to the robot"): r".*/BatteryState|power_msgs/.*",
    say("speech goes through the console’s tasks"): r"sound_play/.*",
}
_CALLED_TYPES = {
    _VELOCITY: r".*/\w*(Twist|Velocit|CmdVel|Speed)\w*|gazebo_msgs/.*",
    say(
        "controllers and their configuration bypass the gate"
    ): r"(controller_manager_msgs|dynamic_reconfigure|rcl_interfaces|lifecycle_msgs|composition_interfaces|"
    r"topic_tools|nodelet|rosapi)/.*|.*/\w*(Controller|Reconfigure|SetParam)\w*",
    say("goals and cancels of actions go through the console’s tasks"): r"action_msgs/.*|.*/action/.*",
    say("the gate uses depth images and clouds"): r".*/\w*SetCameraInfo",
    say("the gate uses odometry"): r"robot_localization/.*|.*/\w*Odom\w*",
    say("power belongs to the robot"): r"power_msgs/.*",
}

# Types whose bytes are accepted under other names: ROS compares md5 sums, not type names.
COUNTERFEITED = (
    *("geometry_msgs/Twist", "geometry_msgs/TwistStamped", "geometry_msgs/TwistWithCovarianceStamped"),
    *("geometry_msgs/Wrench", "trajectory_msgs/JointTrajectory", "actionlib_msgs/GoalID", "sensor_msgs/Joy"),
    *("sensor_msgs/LaserScan", "sensor_msgs/Range", "sensor_msgs/PointCloud", "sensor_msgs/PointCloud2"),
    *("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/CameraInfo", "nav_msgs/Odometry"),
    *("sensor_msgs/Imu", "sensor_msgs/JointState", "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped"),
    *("rosgraph_msgs/Clock", "sensor_msgs/BatteryState"),
)


def why_denied(what: str, name: str, type: str, topics: Topics, use: str = "") -> str | None:
    """Return why no allow-list of this robot may contain this entry; None if it may.

    `what`: choose (route input of `use` there), publish, call, set. `type` is "" if unknown.
    """
    if not (PARAMETER if what == "set" else FULL_NAME).fullmatch(name):
        return say("it is not a full ROS name")
    if what == "choose":
        return _why_topic_denied(name, type, topics, use)
    return next(_reasons(what, name, type, topics), None)


def why_fields_denied(type: str, fields: Iterable[Field]) -> str | None:
    """Return why a message of this definition may not be published, by its type or its parts; None if it may."""
    return next(_by_parts(type, fields), None)


def names_set(name: str, *values: object) -> Iterator[str]:
    """Yield all parameters that are set or lost when one of these values replaces another at `name`."""
    yield name
    for value in values:
        for key, inner in value.items() if isinstance(value, dict) else ():
            yield from names_set(f"{name}/{key}", inner)


def admissible(allowed: Iterable[Allowed], topics: Topics) -> tuple[Allowed, ...]:
    """Return the entries of an allow-list that are not denied."""
    return tuple(
        entry
        for entry in allowed
        if why_denied(entry.what, entry.name, entry.type, topics, entry.use) is None
    )


def _why_topic_denied(name: str, type: str, topics: Topics, use: str) -> str | None:
    """Return why this topic may not be chosen for input of `use`; None if it may.

    For driving, only the rules about overriding apply: the input has passed the gate.
    """
    default: Topic | None = getattr(topics, use) if use in get_args(Use) else None
    if default is None:
        return say("this robot takes no input for {use}", use=use or say("no use"))
    if type != default.type:
        found = type or say("unknown")
        return say(
            "its type is {type}, but input for {use} needs {wanted}", type=found, use=use, wanted=default.type
        )
    if name != default.name and name in _own(topics):
        return say("the robot uses it for something else")
    return next(_by_name(name, _OVERRIDING if use == "drive" else _OVERRIDING | _CHAIN), None)


def _reasons(what: str, name: str, type: str, topics: Topics) -> Iterator[str]:
    if name in _own(topics):
        yield say("the console itself uses it")
    yield from _by_name(name, _OVERRIDING | _CHAIN | ({} if what == "call" else _POINTS))
    yield from _by_type(type, _SENT_TYPES if what == "publish" else _CALLED_TYPES)


def _own(topics: Topics) -> set[str | None]:
    """Return all topics and actions that the robot's profile names."""
    names: set[str | None] = set(topics.cancelled)
    for field in topics.__struct_fields__:
        sources = getattr(topics, field)
        for source in sources if isinstance(sources, list) else [sources]:
            names |= {getattr(source, part, None) for part in ("name", "topic", "info")}
    return names


def _by_name(name: str, groups: dict[Sentence, str]) -> Iterator[str]:
    words = _words(name)
    return (why for why, meant in groups.items() if any(word in words for word in meant.split()))


def _words(name: str) -> str:
    """Normalise a name: /tiago/scanRaw2 -> _tiago_scan_raw_ _tiago_scanraw_"""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)
    return " ".join(f"_{'_'.join(re.findall('[a-z]+', spelt.lower()))}_" for spelt in (apart, name))


def _by_type(type: str, groups: dict[Sentence, str]) -> Iterator[str]:
    names = {type, bare(type)}
    return (why for why, meant in groups.items() if any(re.fullmatch(meant, name) for name in names))


def _by_parts(type: str, fields: Iterable[Field]) -> Iterator[str]:
    yield from _by_type(type, _SENT_TYPES)
    for field in fields:
        yield from _by_parts(field.type, field.fields)
