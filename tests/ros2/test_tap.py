"""The tap of a ROS 2 robot, at the simulated robot: whole messages in each form."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cbor2
import pytest
from msgspec.structs import replace

from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from tests.bridge.support import CONFIG
from tests.processes import until
from tests.ros2.side import Side, needs_rclpy
from tests.ros2.test_simulator import Visitor, robot  # noqa: F401  (it runs for this module too)
from tests.tap_process import Tap

ODOMETRY = "mobile_base_controller/odom"

pytestmark = needs_rclpy


@pytest.fixture(scope="module")
def tap(domain: int, robot: Side, short_folder: Path):  # noqa: F811
    config = replace(
        CONFIG,
        ros=Ros2(domain_id=domain, discovery="localhost"),
        state_dir=str(short_folder),
        link=LinkAddress(unix_path=str(short_folder / "sockets" / "bridge")),
    )
    process = Tap(config, os.environ | ros_environment([MESSAGES, WHEELS]) | domain_environment(domain))
    yield process
    process.stop()


def test_json_and_cbor_have_all_fields_and_raw_is_cdr(tap: Tap) -> None:
    tap.want(**{ODOMETRY: "json raw", "scan_raw": "cbor"})
    read = json.loads(tap.hears(ODOMETRY))
    assert set(read["header"]["stamp"]) == {"sec", "nanosec"} and read["child_frame_id"] == "base_footprint"
    assert tap.hears(ODOMETRY, "raw").startswith(b"\0\1\0\0")
    ranges = cbor2.loads(tap.hears("scan_raw", "cbor"))["ranges"]
    assert (ranges.tag, len(ranges.value)) == (85, 4 * 666)
    state = tap.states[f"/{ODOMETRY}", None]
    assert (state.type, state.latched, state.refusal) == ("nav_msgs/msg/Odometry", False, None)
    assert state.md5.startswith("RIHS01_") and "MSG: geometry_msgs/Pose" in state.definition
    assert tap.typed[f"/{ODOMETRY}"]


def test_who_comes_later_gets_messages_that_stay(tap: Tap) -> None:
    tap.want(map="json")
    first = tap.hears("map")
    assert tap.states["/map", None].latched
    tap.messages.clear()
    tap.want(map="json cbor")
    assert len(tap.hears("map", "cbor")) > 1000 and json.loads(first)["info"]["width"] > 0


def test_a_topic_without_publisher_is_refused_until_one_comes(tap: Tap, domain: int) -> None:
    tap.want(nobody="json")
    tap.refuses("nobody", "no_publisher")
    visitor = Visitor("tests.ros2.visitor", domain)
    try:
        for _ in range(2):  # the visitor waits for a listener; after that it sends at once
            visitor.ask(publish="/nobody", kind="std_msgs/String", fields={"data": "here"})
        assert json.loads(tap.hears("nobody")) == {"data": "here"}
        until(lambda: tap.states["/nobody", None].type == "std_msgs/msg/String", "its state")
    finally:
        visitor.close()
