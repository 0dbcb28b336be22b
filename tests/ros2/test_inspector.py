"""The inspector of a ROS 2 robot, at the simulated robot: its topics, types, services, parameters."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from msgspec.structs import replace

from robots.bridge.topics.inspector_messages import Check
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from tests.bridge.support import CONFIG
from tests.inspector_process import InspectorProcess
from tests.processes import until
from tests.ros2.side import Side, needs_rclpy
from tests.ros2.test_simulator import Visitor, robot  # noqa: F401  (it runs for this module too)

ODOMETRY = "/mobile_base_controller/odom"
NOTES = Allowed("publish", "/notes", "std_msgs/msg/String")

pytestmark = needs_rclpy


@pytest.fixture(scope="module")
def inspector(domain: int, robot: Side, tmp_path_factory: pytest.TempPathFactory):  # noqa: F811
    folder: Path = tmp_path_factory.mktemp("inspector")
    config = replace(
        CONFIG,
        ros=Ros2(domain_id=domain, discovery="localhost"),
        state_dir=str(folder),
        allowed=[NOTES],
    )
    environment = os.environ | ros_environment([MESSAGES, WHEELS]) | domain_environment(domain)
    process = InspectorProcess(config, environment)
    until(lambda: row_of(process, ODOMETRY), "the simulated robot")
    yield process
    assert process.stop() == 0


def test_topics_actions_and_services_have_nodes_and_types(inspector: InspectorProcess) -> None:
    graph = inspector.ask(wire.ListTopics())
    topics = {row.name: row for row in graph.topics}
    assert topics[ODOMETRY].type == "nav_msgs/msg/Odometry"
    assert len(topics[ODOMETRY].publishers) == 1
    assert topics["/key_vel"].subscribers == topics[ODOMETRY].publishers
    actions = {row.name: row.type for row in graph.actions}
    assert actions["/navigate_to_pose"] == "nav2_msgs/action/NavigateToPose"
    assert not [row.name for row in graph.services if "parameter" in row.name or "_action" in row.name]


def test_a_topic_is_shown_with_its_rate_and_age(inspector: InspectorProcess) -> None:
    inspector.subscribe(**{ODOMETRY.strip("/"): 10.0, "map": 1.0})
    sample = inspector.shown(ODOMETRY, lambda one: one.rate_hz and one.fields)
    assert sample.fields["child_frame_id"] == "base_footprint"
    assert set(sample.fields["header"]["stamp"]) == {"sec", "nanosec"}
    assert sample.type == "nav_msgs/msg/Odometry" and sample.age_s is not None and sample.age_s < 1.0
    kept = inspector.shown("/map", lambda one: one.fields)
    assert kept.shortened["data"] > 1000 and kept.publishers == 1
    inspector.subscribe()


def test_definitions_come_from_installed_packages(inspector: InspectorProcess) -> None:
    described = inspector.ask(wire.Describe("geometry_msgs/msg/PoseStamped"))
    assert [field.name for field in described.fields] == ["header", "pose"]
    assert described.md5.startswith("RIHS01_") and "MSG: builtin_interfaces/Time" in described.text
    assert inspector.ask(wire.Describe("lab_msgs/msg/Lamp")).refusal.code == "type_unknown"


def test_parameters_are_those_of_nodes(inspector: InspectorProcess) -> None:
    names = inspector.ask(wire.ListParameters()).names
    motion = next(name for name in names if name.startswith("/play_motion2:motions."))
    node, _, path = motion.partition(":")
    assert inspector.ask(wire.GetParameter(motion)).value is not None
    tree = inspector.ask(wire.GetParameter(node)).value
    assert path.split(".")[1] in tree["motions"]
    assert inspector.ask(wire.GetParameter("/play_motion2:nothing")).refusal.code == "no_parameter"
    assert inspector.ask(wire.GetParameter("/nobody")).refusal.code == "no_parameter"
    assert inspector.ask(wire.SetParameter(motion, 1.0)).refusal.code == "not_allowed"


def test_a_message_is_published_if_the_allow_list_has_it(inspector: InspectorProcess, domain: int) -> None:
    assert inspector.done(lambda number: Check(number, order("/diary"))).code == "not_allowed"
    listener = Visitor("tests.ros2.visitor", domain)
    try:
        listener.ask(listen=NOTES.name, kind="std_msgs/String")
        until(lambda: row_of(inspector, NOTES.name), "the listener")
        assert inspector.done(lambda number: Check(number, order(NOTES.name))) is None
        inspector.send(order(NOTES.name))
        assert listener.hear(NOTES.name) == {"data": "hello"}
    finally:
        listener.close()


def order(topic: str) -> wire.Publish:
    return wire.Publish(1, topic, NOTES.type, {"data": "hello"})


def row_of(inspector: InspectorProcess, topic: str) -> wire.TopicRow | None:
    return next((row for row in inspector.ask(wire.ListTopics()).topics if row.name == topic), None)
