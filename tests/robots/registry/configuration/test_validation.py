"""Errors of a robot or profile are shown in words at the field, with the path inside the field."""

from __future__ import annotations

import re
import subprocess
import sys
from copy import deepcopy
from typing import Any, get_args, get_type_hints

import pytest
from django.core.exceptions import ValidationError

from robots.registry.configuration import robot_config
from robots.registry.models import Robot, RobotProfile
from robots.registry.shipped_profiles import profile_files
from robots.shared.configuration.bridge_config import TOPIC_TYPES, Topic, Topics
from robots.shared.configuration.gate_profile import Parameters

pytestmark = pytest.mark.django_db

# A new web process, in which several pages use the schema for the first time, all together.
FIRST_USES = """
import sys, threading
from robots.registry.configuration import profile_schema
from robots.registry.configuration.profile_schema import Footprint, Overrides, Parameters, Problems, StickChain, Topics

sys.setswitchinterval(1e-6)
together = threading.Barrier(4)

def parse():
    for kind in (Footprint, Overrides, Parameters, StickChain, Topics):
        together.wait()
        try:
            profile_schema.parsed(kind, {name: 1.0 for name in kind.__struct_fields__})
        except Problems:
            pass

threads = [threading.Thread(target=parse) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def complaint(entry: Robot | RobotProfile, field: str) -> str:
    with pytest.raises(ValidationError) as caught:
        entry.full_clean(validate_unique=False)
    assert list(caught.value.message_dict) == [field]
    return " ".join(caught.value.message_dict[field])


def test_every_shipped_profile_is_valid() -> None:
    assert {file.slug for file in profile_files()} == {
        "tiago",
        "tiago-ros2",
        "pmb2",
        "pmb2-ros2",
        "generic-differential",
        "generic-holonomic",
    }
    for profile in RobotProfile.objects.all():
        profile.full_clean()


def test_threads_that_parse_their_first_at_once_crash_nothing() -> None:
    for _ in range(2):
        assert subprocess.run([sys.executable, "-c", FIRST_USES], check=False).returncode == 0


def test_a_robot_with_only_a_master_is_valid(robot: Robot) -> None:
    robot.full_clean()


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("tiago-42c:11311", "does not begin with http://"),
        ("https://tiago-42c:11311", "does not begin with http://"),
        ("http://tiago-42c", "names no port"),
        ("http://:11311", "names no host"),
        ("http://tiago-42c:99999", "no valid port"),
        ("http://tiago-42c:0", "no valid port"),
        ("http://tiago-42c:", "names no port"),
        ("http://user:pass@tiago-42c:11311", "has a user or password"),
        ("http://tiago-42c\t:11311", "control characters"),
        ("http://[::1]:11311", "has an IPv6 address. ROS 1 nodes reach each other by IPv4"),
        ("http://[::FFFF:10.0.0.1]:11311/", "has an IPv6 address"),
        ("http://[fe80::1%25eth0]:11311", "has an IPv6 address"),
        ("HTTP://[2001:DB8::7]", "has an IPv6 address"),
        ("http://[::1:11311", "brackets that do not fit"),
        ("http://tiago-42c:11311/rpc", "something after the port"),
        ("http://tiago 42c:11311", "spaces or control characters"),
        (" http://tiago-42c:11311", "spaces or control characters"),
        ("http://tiago-42c:11311\u00a0", "spaces or control characters"),
        *(
            (f"http://{host}:11311", "is the address of no computer")
            for host in ("0.0.0.0", "0.0.0.7", "[::]", "224.0.0.1", "255.255.255.255")  # noqa: S104
        ),
        ("http://tiago-42c:11311?", "something after the port"),
        ("http://tiago-42c:11311#", "something after the port"),
        ("http://10.68.0.300:11311", "neither an IP address"),
    ],
)
def test_a_wrong_master_uri_is_refused_with_the_right_form(robot: Robot, uri: str, said: str) -> None:
    robot.master_uri = uri
    text = complaint(robot, "master_uri")
    assert said in text
    assert "http://host:port" in text


@pytest.mark.parametrize(
    "uri", ["HTTP://TIAGO-42C:11311", "http://tiago-42c.local.:11311/", "http://10.68.0.1:1"]
)
def test_other_forms_of_a_master_uri_are_taken(robot: Robot, uri: str) -> None:
    robot.master_uri = uri
    robot.full_clean()


@pytest.mark.parametrize("address", ["::1", "fd00::2"])
def test_an_advertised_address_of_ipv6_is_refused(robot: Robot, address: str) -> None:
    robot.advertised_address = address
    assert "is an IPv6 address. ROS 1 nodes reach each other by IPv4" in complaint(
        robot, "advertised_address"
    )


@pytest.mark.parametrize("address", ["10.68.0", "http://console", "console lab", "-console"])
def test_an_advertised_address_is_an_address_or_a_name(robot: Robot, address: str) -> None:
    robot.advertised_address = address
    assert "neither an IP address" in complaint(robot, "advertised_address")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("advertised_address", "0.0.0.0"),  # noqa: S104
        ("bridge_address", "wss://[::ffff:0.0.0.0]:7443"),
        ("host_aliases", {"tiago-42c": "0.0.0.0"}),  # noqa: S104
    ],
)
def test_an_address_of_no_computer_is_refused(robot: Robot, field: str, value: Any) -> None:
    setattr(robot, field, value)
    assert "is the address of no computer" in complaint(robot, field)


@pytest.mark.parametrize(
    ("aliases", "said"),
    [
        (["tiago-42c"], "object of names and addresses"),
        ({"tiago-42c": "tiago"}, "tiago-42c: 'tiago' is not an IP address"),
        ({"tiago-42c": "fd00::7"}, "tiago-42c: 'fd00::7' is an IPv6 address"),
        ({"tiago-42c": 5}, "tiago-42c: 5 is not an IP address"),
        ({"tiago-42c": "fe80::1%a\n10.0.0.1 b"}, "is not an IP address"),
        ({"tiago-42c\n": "10.68.0.1"}, "is not a host name"),
        ({"10.68.0.1": "10.68.0.1"}, "'10.68.0.1' is not a host name"),
        ({"tiago 42c": "10.68.0.1"}, "'tiago 42c' is not a host name"),
    ],
)
def test_aliases_map_host_names_to_addresses(robot: Robot, aliases: Any, said: str) -> None:
    robot.host_aliases = aliases
    assert said in complaint(robot, "host_aliases")


def test_a_bridge_elsewhere_is_reached_by_tls_only(robot: Robot) -> None:
    robot.bridge_address = "ws://bridges.lab:7443"
    assert "does not begin with wss://" in complaint(robot, "bridge_address")


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (("odometry",), None, "odometry: Expected an object, got null"),
        (("odometry", "name"), "odom", "odometry.name: 'odom' is not a full ROS name"),
        (("odometry", "type"), "nav_msgs/Path", "odometry.type: 'nav_msgs/Path' is not understood here"),
        (("battery", "type"), "std_msgs/Int8", "only std_msgs/Float32 or sensor_msgs/BatteryState"),
        (("map", "type"), "nav_msgs/GetMap", "only nav_msgs/OccupancyGrid"),
        (("map", "name"), "map", "map.name"),
        (("scans", 0, "pose"), [0.2, 0.0], "scans[0].pose: Expected a list of length 3"),
        (("scans", 0, "pose"), [0.2, "0", 0.0], "scans[0].pose[1]: Expected a number, got text"),
        (
            ("scans", 0, "pose"),
            [0.2, float("nan"), 0.0],
            "scans[0].pose[1]: must be a finite number, not nan",
        ),
        (("scans", 0, "pose"), [202.0, 0.0, 0.0], "poses are in metres"),
        (("scans", 0, "pose"), [0.2, 0.0, 90.0], "angles are in radians"),
        (("scans", 0, "topics"), "/scan", "scans[0].topics: there is no such field (there are: pose, topic)"),
        (("sonars", 1, "fov"), 30.0, "sonars[1].fov: must be between 0 and 3.14 rad, not 30"),
        (("sonars", 1, "frame_id"), "base_sonar_01_link", "'base_sonar_01_link' occurs twice"),
        (("laser",), "/scan", "laser: there is no such field"),
        (("drive",), {"name": "/cmd_vel"}, 'drive: belongs into the field "drive topic"'),
        (("head", "point_head"), "look", "head.point_head: 'look' is not a full ROS name"),
        (("speech", "others"), [{"name": "say", "type": "std_msgs/String"}], "speech.others[0].name: 'say'"),
        (("speech", "others"), [{"name": "/say", "type": "x/Y"}], "speech.others[0].type: 'x/Y'"),
        (("speech", "others"), [{"name": "/tts", "type": "std_msgs/String"}], "'/tts' occurs twice"),
        (("map", "others"), [{"name": "/m", "type": "nav_msgs/OccupancyGrid"}], "map.others: only speech"),
        (("cancel_on_stop", 0), "tts", "cancel_on_stop[0]: 'tts' is not a full ROS name"),
    ],
)
def test_a_wrong_field_of_the_ros_interface_is_named_by_its_path(
    tiago: RobotProfile, place: tuple[Any, ...], value: Any, said: str
) -> None:
    tiago.topics = deepcopy(tiago.topics)
    inside = tiago.topics
    for step in place[:-1]:
        inside = inside[step]
    inside[place[-1]] = value
    assert said in complaint(tiago, "topics")


@pytest.mark.parametrize(
    ("footprint", "said"),
    [
        ({}, 'either "radius_m"'),
        ({"radius_m": 0.27, "outline": [[1, 1], [-1, 1], [0, -1]]}, 'either "radius_m"'),
        ({"radius_m": 27.0}, "between 0.05 and 2 m"),
        ({"outline": [[0.3, 0.3], [-0.3, -0.3]]}, "at least 3 corners"),
        ({"outline": [[0.3, 0.3], [-0.3, 0.3], [0.0, 0.0], [-0.3, -0.3], [0.3, -0.3]]}, "convex"),
        ({"outline": [[0.0, 0.3], [0.2, -0.3], [-0.3, 0.1], [0.3, 0.1], [-0.2, -0.3]]}, "once around"),
        ({"outline": [[0.3, 0.3], [-0.3, 0.3], [-0.3, 0.3], [0.3, -0.3]]}, "convex"),
        ({"outline": [[0.9, 0.3], [0.5, 0.3], [0.5, -0.3], [0.9, -0.3]]}, "must lie inside"),
        ({"outline": [[30, 30], [-30, 30], [-30, -30], [30, -30]]}, "in metres"),
    ],
)
def test_a_footprint_is_a_disc_or_convex_around_the_origin(
    tiago: RobotProfile, footprint: Any, said: str
) -> None:
    tiago.footprint = footprint
    assert said in complaint(tiago, "footprint")


def test_an_outline_written_clockwise_goes_counter_clockwise(tiago: RobotProfile) -> None:
    tiago.footprint = {"outline": [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]}
    tiago.full_clean()
    assert robot_config.footprint(tiago).outline == [(-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2), (0.3, 0.2)]


@pytest.mark.parametrize(
    ("gate", "said"),
    [
        ({"front_margin_m": 0.0}, "front_margin_m: must be between 0.03 and 1, not 0"),
        ({"deceleration_share": 1.5}, "deceleration_share: must be between 0.1 and 0.9, not 1.5"),
        ({"off": True}, "off: there is no such field"),
        ({"latency_s": "long"}, "latency_s: Expected a number, got text"),
    ],
)
def test_no_parameter_turns_the_gate_off(tiago: RobotProfile, gate: Any, said: str) -> None:
    tiago.gate = gate
    assert said in complaint(tiago, "gate")


@pytest.mark.parametrize("share", [0.0, -0.4, 1.1])
def test_a_largest_share_is_above_0_and_at_most_1(robot: Robot, share: float) -> None:
    robot.max_share = share
    assert complaint(robot, "max_share")


def test_the_default_speed_is_at_most_0_4_mps(robot: Robot) -> None:
    robot.default_share = 0.6
    assert (
        "0.6 of 1 m/s is 0.6 m/s; the first speed may be at most 0.4 m/s, so the share at most 0.4"
        in complaint(robot, "default_share")
    )


def test_a_robot_that_is_slower_may_begin_with_a_larger_share(robot: Robot) -> None:
    robot.default_share, robot.overrides = 0.8, {"limits": {"forward_mps": 0.5}}
    robot.full_clean()


def test_a_differential_base_does_not_move_sideways(tiago: RobotProfile) -> None:
    tiago.lateral_mps = 0.2
    assert "cannot move sideways" in complaint(tiago, "lateral_mps")


def test_the_help_names_every_figure_of_the_gate() -> None:
    named = re.findall(r"\w+", str(RobotProfile._meta.get_field("gate").help_text))
    assert set(Parameters.__struct_fields__) <= set(named)


def test_every_topic_has_types_that_are_understood() -> None:
    of_one_topic = {name for name, hint in get_type_hints(Topics).items() if Topic in (hint, *get_args(hint))}
    for types in TOPIC_TYPES.values():
        assert of_one_topic <= types.keys() <= get_type_hints(Topics).keys()
