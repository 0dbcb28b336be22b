"""Questions of a check to a robot: the topics that its profile and its entry name."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import structs

from robots.shared.configuration.bridge_config import BridgeConfig, Topic, Topics
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.messages.type_names import bare, in_ros2
from robots.shared.processes.probe_findings import FEEDBACK, Listened, Plan

STAMPED = ("sensor_msgs/BatteryState", "diagnostic_msgs/DiagnosticArray")
GOALS = "/_action/feedback"  # of an action of ROS 2: silent until the first goal


def plan_for(config: BridgeConfig) -> Plan:
    """Return the topics that the robot's profile and entry name."""
    topics = config.topics
    commands = dict(_commands(topics)) if isinstance(config.ros, Ros2) else {}
    return Plan(config.ros, topics.drive, listened_of(config), arm=topics.arm, commands=commands)


def listened_of(config: BridgeConfig) -> list[Listened]:
    """Return the topics to subscribe to."""
    found = [*_sensors(config.topics)]
    if isinstance(config.ros, Ros2):
        found = [structs.replace(one, type=in_ros2(one.type)) for one in found]
        return [*found, *_frames(config), *_actions_2(config.topics)]
    return [*found, *_actions(config.topics)]


def _sensors(topics: Topics) -> Iterator[Listened]:
    yield Listened("odometry", topics.odometry.name, topics.odometry.type, stamped=True)
    for scan in topics.scans:
        yield Listened(f"scan {scan.topic}", scan.topic, "sensor_msgs/LaserScan", stamped=True)
    for topic in sorted({sonar.topic for sonar in topics.sonars}):
        frames = [sonar.frame_id for sonar in topics.sonars if sonar.topic == topic]
        yield Listened(f"sonars {topic}", topic, "sensor_msgs/Range", stamped=True, frames=frames)
    if topics.depth:
        yield Listened("depth", topics.depth.topic, topics.depth.type, stamped=True)
    if topics.joint_states:
        yield Listened("joint states", topics.joint_states.name, topics.joint_states.type, stamped=True)
    for camera in topics.cameras:
        yield Listened(f"camera {camera.topic}", camera.topic, camera.type, stamped=True)
    for what in ("battery", "charging", "diagnostics"):
        if source := getattr(topics, what):
            yield Listened(what, source.name, source.type, stamped=bare(source.type) in STAMPED)
    if topics.map:
        yield Listened("map", topics.map.name, topics.map.type, stamped=False, kept="may")


def _frames(config: BridgeConfig) -> Iterator[Listened]:
    """Yield the topic with the robot's fixed frames, if the bridge reads it."""
    topics = config.topics
    if isinstance(config.ros, Ros2) and (topics.depth or topics.map or topics.navigation):
        name = f"{config.ros.namespace}/tf_static"
        yield Listened("fixed frames", name, "tf2_msgs/msg/TFMessage", stamped=False, kept="must")


def _actions_2(topics: Topics) -> Iterator[Listened]:
    """Yield the topic of each action on which its server tells of goals. Its type differs from action to action."""
    actions = {what: topic for what in ("speech", "motions") if (topic := getattr(topics, what))}
    actions |= {limb: Topic(source.action, source.type) for limb, source in topics.limbs.items()}
    if source := topics.navigation:
        actions["navigation"] = Topic(source.action, source.type)
    for what, action in ((what, one) for what, topic in actions.items() for one in (topic, *topic.others)):
        if action.is_action:
            yield Listened(what, action.name + GOALS, action.type + FEEDBACK, stamped=False)


def _commands(topics: Topics) -> Iterator[tuple[str, Topic]]:
    """Yield the topics that get commands of a robot with ROS 2, beside the drive topic."""
    if topics.head:
        yield "head", Topic(topics.head.topic, "trajectory_msgs/msg/JointTrajectory")
    if topics.navigation and topics.navigation.set_pose:
        yield "pose", Topic(topics.navigation.set_pose, "geometry_msgs/msg/PoseWithCovarianceStamped")
    if topics.speech and not topics.speech.is_action:
        yield "speech", topics.speech


def _actions(topics: Topics) -> Iterator[Listened]:
    for what in ("speech", "motions"):
        action = getattr(topics, what)
        if action and action.is_action:  # a plain topic for texts has no results
            yield Listened(what, f"{action.name}/result", f"{action.type}Result", stamped=True)
    for limb, source in topics.limbs.items():
        yield Listened(limb, f"{source.action}/result", f"{source.type}Result", stamped=True)
    if topics.navigation:
        status = f"{topics.navigation.action}/status"
        yield Listened("navigation", status, "actionlib_msgs/GoalStatusArray", stamped=True)
