"""Topics and services that no allow-list may permit: they would bypass or blind the chain. Pure.

Names are judged word by word (/power/is_emergency: power, is, emergency), so that a namespace or a number hides
nothing. Types are judged, too, since a robot may name its topics freely. In doubt an entry is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from robots.bridge.config import Allowed, Topic, Topics
from robots.wire import Field

USE_TYPES = {
    "drive": ("geometry_msgs/Twist", "geometry_msgs/TwistStamped"),
    "speech": ("pal_interaction_msgs/TtsAction", "std_msgs/String", "sound_play/SoundRequest"),
    "motions": ("play_motion_msgs/PlayMotionAction",),
}

# what ROS itself would resolve to no other name.
FULL_NAME = re.compile(r"/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*")

_VELOCITY = "velocities move the base: they go through the gate only"

# Why not, and what in a name means it: found anywhere in it, but where an underscore stands a word begins or ends.
# Input on a chosen drive topic has passed the gate, so only the first group is denied.
_OVERRIDING = {
    "controllers, and what configures or loads them, take commands past the gate": "control command trajectory mux "
    "reconfigure param rosapi nodelet bond _script urscript setpoint _pid_",
    "the lab’s own joystick wins over the console, and must": "_joy joystick joypad gamepad teleop _tab_ _tabs_",
    "locks and emergency stops are the robot’s own": "_lock locks locked unlock interlock pause brake breaker stop "
    "halt emergency closing_loop safety deadman collision",
    "what the console calls its own is its own": "fleet_bridge fleet_inspector",
}
_CHAIN = {
    _VELOCITY: "_vel_ _vels_ velocit cmdvel basevel twist speed _drive_ steer throttle gazebo",
    "what turns wheels and motors goes past the gate": "cmd wheel motor servo effort torque _pwm_ _jog",
    "goals and cancels of actions go through the console’s own orders": "goal cancel",
    "the gate sees by scans and ranges": "scan laser lidar hokuyo _sick_ sonar range ultraso bumper cliff",
    "the gate sees by depth pictures and clouds": "depth points cloud disparity camera xtion realsense kinect astra",
    "the gate reckons with odometry": "odom encoder _imu gyro _ekf_ _ukf_ set_pose _reset_",
    "the gate reckons with where the joints are": "joint",
    "frames and clocks tie together what the gate sees": "_tf clock _time_ robot_description robot_state_publisher",
    "the robot’s power is its own, and who docks it drives": "power battery batteries charg dock shutdown reboot",
}

_POINTS = {"what a motion sweeps is judged by its points": "play_motion"}

_SENT_TYPES = {
    _VELOCITY: r"geometry_msgs/(Accel|Wrench).*|(ackermann|gazebo)_msgs/.*|.*/\w*(Twist|Velocit|CmdVel|Speed)\w*",
    "controllers take commands past the gate": r"(trajectory_msgs|control_msgs|controller_manager_msgs|bond)/.*|"
    r".*/\w*JointTrajectory\w*",
    "goals, cancels and what answers them go through the console’s own orders": r"actionlib_msgs/.*|"
    r".*/\w+Action(Goal|Result|Feedback)?",
    "joysticks win over the console, and must": r".*/\w*Joy\w*",
    "the gate sees by scans and ranges": r".*/\w*(LaserScan|LaserEcho|Bumper)\w*|.*/Range",
    "the gate sees by depth pictures and clouds": r".*/\w*(PointCloud|Image|CameraInfo)\w*|"
    r"(stereo_msgs|theora_image_transport)/.*",
    "the gate reckons with odometry": r".*/\w*Odom\w*|.*/Imu",
    "the gate reckons with where the joints are": r".*/\w*JointState\w*",
    "frames and clocks tie together what the gate sees": r"(tf|tf2_msgs)/.*|.*/TransformStamped|rosgraph_msgs/Clock",
    "the robot’s power is its own": r".*/BatteryState|power_msgs/.*",
    "what is spoken goes through the console’s own orders": r"sound_play/.*",
}
_CALLED_TYPES = {
    _VELOCITY: r".*/\w*(Twist|Velocit|CmdVel|Speed)\w*|gazebo_msgs/.*",
    "controllers and what configures them take commands past the gate": r"(controller_manager_msgs|dynamic_reconfigure|"
    r"topic_tools|nodelet|rosapi)/.*|.*/\w*(Controller|Reconfigure|SetParam)\w*",
    "the gate sees by depth pictures and clouds": r".*/\w*SetCameraInfo",
    "the gate reckons with odometry": r"robot_localization/.*|.*/\w*Odom\w*",
    "the robot’s power is its own": r"power_msgs/.*",
}

# Whose bytes, under whatever name, reach the same listeners: ROS compares md5 sums, not the names of types.
COUNTERFEITED = (
    *("geometry_msgs/Twist", "geometry_msgs/TwistStamped", "geometry_msgs/TwistWithCovarianceStamped"),
    *("geometry_msgs/Wrench", "trajectory_msgs/JointTrajectory", "actionlib_msgs/GoalID", "sensor_msgs/Joy"),
    *("sensor_msgs/LaserScan", "sensor_msgs/Range", "sensor_msgs/PointCloud", "sensor_msgs/PointCloud2"),
    *("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/CameraInfo", "nav_msgs/Odometry"),
    *("sensor_msgs/Imu", "sensor_msgs/JointState", "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped"),
    *("rosgraph_msgs/Clock", "sensor_msgs/BatteryState"),
)


def why_denied(what: str, name: str, type: str, topics: Topics, use: str = "") -> str | None:
    """Why no allow-list of this robot admits it, in words; None if one may.

    `what`: choose (input of `use` goes there), publish, call, set. `type` "" where it is not known.
    """
    if not FULL_NAME.fullmatch(name):
        return "it is no full ROS name"
    if what == "choose":
        return _why_topic_denied(name, type, topics, use)
    return next(_reasons(what, name, type, topics), None)


def why_fields_denied(type: str, fields: Iterable[Field]) -> str | None:
    """Why nobody publishes a message of this definition, for what it is or what is within it; None if one may."""
    return next(_by_parts(type, fields), None)


def names_set(name: str, *values: object) -> Iterator[str]:
    """Every parameter that is set, or lost, where one of these values takes the place of another at `name`."""
    yield name
    for value in values:
        for key, inner in value.items() if isinstance(value, dict) else ():
            yield from names_set(f"{name}/{key}", inner)


def admissible(allowed: Iterable[Allowed], topics: Topics) -> tuple[Allowed, ...]:
    """Those entries of an allow-list that may be on it."""
    return tuple(
        entry
        for entry in allowed
        if why_denied(entry.what, entry.name, entry.type, topics, entry.use) is None
    )


def _why_topic_denied(name: str, type: str, topics: Topics, use: str) -> str | None:
    """A chosen topic gets gated input. It must not have priority over a person's joystick or a lock."""
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
    return (why for why, meant in groups.items() if any(word in words for word in meant.split()))


def _words(name: str) -> str:
    """/tiago/scanRaw2 -> _tiago_scan_raw_ _tiago_scanraw_"""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)
    return " ".join(f"_{'_'.join(re.findall('[a-z]+', spelt.lower()))}_" for spelt in (apart, name))


def _by_type(type: str, groups: dict[str, str]) -> Iterator[str]:
    return (why for why, meant in groups.items() if re.fullmatch(meant, type))


def _by_parts(type: str, fields: Iterable[Field]) -> Iterator[str]:
    yield from _by_type(type, _SENT_TYPES)
    for field in fields:
        yield from _by_parts(field.type, field.fields)
