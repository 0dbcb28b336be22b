"""Which nodes are named as publishers of velocities for the base."""

from __future__ import annotations

import pytest

from robots.bridge.robot.network.velocity_sources import velocity_sources
from robots.shared.graph import SystemState

TWIST, ODOMETRY = "geometry_msgs/Twist", "/mobile_base_controller/odom"
COMMAND = "/mobile_base_controller/cmd_vel"


def graph(publishers: dict[str, list[str]], subscribers: dict[str, list[str]]) -> SystemState:
    topics = publishers.keys() | subscribers.keys()
    types = {topic: "nav_msgs/Odometry" if "odom" in topic else TWIST for topic in topics}
    return SystemState(publishers, subscribers, types | {"/scan": "sensor_msgs/LaserScan"}, {})


def tiago(**more: list[str]) -> SystemState:
    """A TIAGo: twist_mux between its inputs and the controller."""
    publishers = {
        ODOMETRY: ["/ros_control"],
        COMMAND: ["/twist_mux", *more.get("command", [])],
        "/key_vel": ["/fleet_bridge", "/fleet_watchdog_1", *more.get("drive", [])],
        "/nav_vel": ["/move_base"],
        "/scan": ["/laser"],
        "/turtle/cmd_vel": ["/turtle_teleop"],
    }
    subscribers = {
        COMMAND: ["/ros_control"],
        "/key_vel": ["/twist_mux"],
        "/nav_vel": ["/twist_mux"],
        "/scan": ["/move_base"],
        "/turtle/cmd_vel": ["/turtle"],
    }
    return graph(publishers, subscribers)


def test_a_node_that_passes_by_the_mux_comes_first():
    found = velocity_sources(tiago(command=["/rogue"]), "/key_vel", ODOMETRY)
    assert list(found.items()) == [(COMMAND, ["/rogue", "/twist_mux"]), ("/nav_vel", ["/move_base"])]


def test_publishers_of_the_drive_topic_are_named_without_ours():
    found = velocity_sources(tiago(drive=["/joy"]), "/key_vel", ODOMETRY)
    assert found == {COMMAND: ["/twist_mux"], "/key_vel": ["/joy"], "/nav_vel": ["/move_base"]}


def test_a_controller_that_takes_the_drive_topic_itself():
    system = graph(
        {"/odom": ["/base"], "/cmd_vel": ["/fleet_bridge", "/rogue"]}, {"/cmd_vel": ["/base", "/logger"]}
    )
    assert velocity_sources(system, "/cmd_vel", "/odom") == {"/cmd_vel": ["/rogue"]}


def test_odometry_of_another_node_than_the_controller():
    system = graph(
        {"/odom": ["/ekf"], "/cmd_vel": ["/rogue"], "/raw": ["/smoother"]},
        {"/cmd_vel": ["/smoother"], "/raw": ["/base"], "/odom": ["/fleet_bridge"]},
    )
    assert velocity_sources(system, "/cmd_vel", "/odom") == {"/raw": ["/smoother"], "/cmd_vel": ["/rogue"]}


@pytest.mark.parametrize("publishers", [{ODOMETRY: ["/base"], "/cmd_vel": ["/fleet_bridge"]}, {}])
def test_nobody_is_named_where_only_the_console_publishes(publishers):
    assert velocity_sources(graph(publishers, {"/cmd_vel": ["/base"]}), "/cmd_vel", ODOMETRY) == {}


def test_many_and_long_names_stay_small():
    nodes = [f"/{number}{'x' * 180}" for number in range(100)]
    system = graph({"/odom": ["/base"], **{f"/cmd_{n}": nodes for n in range(9)}}, {})
    system.subscribers.update({f"/cmd_{n}": ["/base"] for n in range(9)})
    found = velocity_sources(system, "/cmd_0", "/odom")
    assert len(found) == 3 and found["/cmd_0"][-1] == "+97"
    assert len(str(found)) < 2000
