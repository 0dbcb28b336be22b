"""A robot may change its profile's ROS interface freely, but its limits only to safer values."""

from __future__ import annotations

from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.test import override_settings

from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot, RobotProfile
from robots.registry.selectors import bridge_config, require_link_settings, robot_facts

pytestmark = pytest.mark.django_db

DEPTH = {"topic": "/depth", "type": "sensor_msgs/Image", "height_m": 1.1}
ARM = {"home": {"arm_1_joint": 0.2}, "links": ["arm_1_link", "arm_7_link"]}
HEAD = {"topic": "/head_controller/command", "pan_joint": "head_1_joint", "tilt_joint": "head_2_joint"}


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"limits": {"forward_mps": 1.2}}, "limits.forward_mps: 1.2 is above the profile’s 1"),
        ({"limits": {"blind_mps": 0.5}}, "limits.blind_mps: 0.5 is above the profile’s 0.3"),
        ({"limits": {"linear_mps2": 2.0}}, "limits.linear_mps2: 2 is above the profile’s 1"),
        ({"limits": {"turn_radps": 0.0}}, "limits.turn_radps: must be above 0"),
        ({"limits": {"reverse_mps": -0.1}}, "limits.reverse_mps: must not be negative"),
        ({"gate": {"front_margin_m": 0.05}}, "gate.front_margin_m: 0.05 is below the profile’s 0.08"),
        ({"gate": {"deceleration_share": 0.9}}, "gate.deceleration_share: 0.9 is above the profile’s 0.65"),
        ({"gate": {"latency_s": 5.0}}, "gate.latency_s: must be between 0.1 and 1, not 5"),
        (
            {"topics": {"scans": [{"topic": "scan", "pose": [0, 0, 0]}]}},
            "topics.scans[0].topic: 'scan' is not",
        ),
        (
            {"topics": {"depth": DEPTH | {"height_m": 0.9}}},
            "topics.depth.height_m: 0.9 is below the profile’s 1.1",
        ),
        (
            {"topics": {"depth": DEPTH | {"own_m": 0.2}}},
            "topics.depth.own_m: 0.2 is above the profile’s 0.05",
        ),
        (
            {"topics": {"depth": DEPTH | {"blind_m": 0.3}}},
            "topics.depth.blind_m: 0.3 is below the profile’s 0.5",
        ),
        (
            {"topics": {"depth": DEPTH | {"fov": 63.0}}},
            "topics.depth.fov: must be between 0.2 and 2.8 rad, not 63",
        ),
        (
            {"topics": {"depth": DEPTH | {"every_s": 2.0}}},
            "topics.depth.every_s: must be between 0.02 and 0.4 s",
        ),
        ({"topics": {"depth": DEPTH | {"info": "info"}}}, "topics.depth.info: 'info' is not"),
        ({"topics": {"head": HEAD | {"look_tilt": -40}}}, "topics.head.look_tilt: must be between"),
        ({"topics": {"head": HEAD | {"pan_joint": ""}}}, "topics.head.pan_joint: must name a joint"),
        (
            {"topics": {"arm": ARM | {"tolerance": 0.4}}},
            "topics.arm.tolerance: 0.4 is above the profile’s 0.15",
        ),
        (
            {"topics": {"arm": ARM | {"radius_m": 0.03}}},
            "topics.arm.radius_m: 0.03 is below the profile’s 0.07",
        ),
        ({"topics": {"arm": ARM | {"home": {}}}}, "topics.arm.home: must name the arm’s joints"),
        ({"topics": {"arm": ARM | {"links": ["hand"]}}}, "topics.arm.links: must name the arm’s links"),
        ({"topics": {"arm": ARM, "joint_states": None}}, "topics.arm: needs joint_states"),
        ({"topics": {"lidar": "/scan"}}, "topics.lidar: there is no such field"),
        ({"speed": 2}, "speed: there is no such field (there are: gate, limits, topics)"),
    ],
)
def test_looser_or_unfit_overrides_are_refused_by_name(robot: Robot, overrides: Any, said: str) -> None:
    robot.overrides = overrides
    with pytest.raises(ValidationError) as caught:
        robot.full_clean()
    assert said in " ".join(caught.value.message_dict["overrides"])


def test_tighter_overrides_reach_gate_and_page(robot: Robot) -> None:
    robot.overrides = {
        "limits": {"forward_mps": 0.5, "reverse_mps": 0.0, "blind_mps": 0.2},
        "gate": {"front_margin_m": 0.2, "deceleration_share": 0.5},
    }
    robot.full_clean()
    gate = bridge_config(robot).gate
    assert (gate.limits.forward_mps, gate.limits.reverse_mps, gate.blind_mps) == (0.5, 0.0, 0.2)
    assert (gate.parameters.front_margin_m, gate.parameters.deceleration_share) == (0.2, 0.5)
    assert gate.limits.turn_radps == robot.profile.turn_radps
    assert robot_facts(robot).limits.forward_mps == 0.5


def test_a_lowered_profile_limits_a_robot_with_own_limits(robot: Robot) -> None:
    robot.overrides = {"limits": {"forward_mps": 0.5}}
    robot.profile.forward_mps = 0.3
    assert bridge_config(robot).gate.limits.forward_mps == 0.3


def test_a_robot_marks_a_missing_sensor_with_null(robot: Robot) -> None:
    robot.overrides = {"topics": {"depth": None}}
    robot.full_clean()
    assert bridge_config(robot).topics.depth is None


def test_own_depth_topic_and_following_head_reach_the_bridge(robot: Robot) -> None:
    robot.overrides = {"topics": {"depth": DEPTH | {"own_m": 0.03}, "head": HEAD | {"follows_turn": True}}}
    robot.full_clean()
    config = bridge_config(robot)
    assert config.topics.head and config.topics.head.follows_turn
    assert config.topics.depth and config.topics.depth.topic == "/depth"
    assert config.gate.depth and (config.gate.depth.height_m, config.gate.depth.own_m) == (1.1, 0.03)
    assert robot_facts(robot).has_head


@pytest.mark.parametrize("missing", ["map", "navigation"])
def test_a_page_has_the_map_of_a_robot_that_can_be_sent_to_its_places(robot: Robot, missing: str) -> None:
    assert robot_facts(robot).has_map
    robot.overrides = {"topics": {missing: None}}
    assert not robot_facts(robot).has_map


@pytest.mark.parametrize("kind", ["scans", "sonars"])
def test_one_robot_cannot_lose_a_watching_sensor(robot: Robot, kind: str) -> None:
    robot.overrides = {"topics": {kind: []}}
    with pytest.raises(ValidationError, match=rf"topics\.{kind}: 0 here, \d in the profile"):
        robot.full_clean()
    with pytest.raises(Problems):
        bridge_config(robot)  # if the database has such a robot all the same, its bridge does not run


def test_a_tightened_profile_reaches_own_gate_parameters(robot: Robot) -> None:
    robot.overrides = {"gate": {"front_margin_m": 0.2, "creep_mps": 0.08}}
    robot.profile.gate = {"front_margin_m": 0.5, "creep_mps": 0.05}
    parameters = bridge_config(robot).gate.parameters
    assert (parameters.front_margin_m, parameters.creep_mps) == (0.5, 0.05)


def test_a_profile_made_faster_later_makes_no_beginner_faster(robot: Robot) -> None:
    robot.default_share = 0.6  # valid while the limit was 0.6 m/s
    robot.profile.forward_mps = 1.0
    facts = robot_facts(robot)
    assert facts.default_share * facts.limits.forward_mps <= 0.4 + 1e-9


def test_a_robot_with_a_misfit_share_can_be_disabled(robot: Robot) -> None:
    robot.default_share = 0.6
    with pytest.raises(ValidationError, match="the first speed may be at most"):
        robot.full_clean()
    robot.enabled = False
    robot.full_clean()


def test_a_robot_above_a_lowered_profile_can_be_disabled(robot: Robot) -> None:
    robot.overrides = {"limits": {"forward_mps": 0.8}, "gate": {"front_margin_m": 0.2}}
    robot.profile.forward_mps = 0.5
    robot.profile.gate = {"front_margin_m": 0.5}
    with pytest.raises(ValidationError, match="above the profile’s"):
        robot.full_clean()
    robot.enabled = False
    robot.full_clean()


@override_settings(FLEET_LINK_CERT=None, FLEET_LINK_KEY=None, FLEET_LINK_SECRET=None)
def test_a_network_bridge_names_its_missing_settings(robot: Robot) -> None:
    require_link_settings(robot)
    robot.bridge_address = "wss://other-host:7443"
    with pytest.raises(Problems, match="FLEET_LINK_CERT, FLEET_LINK_KEY, FLEET_LINK_SECRET"):
        require_link_settings(robot)


def test_a_camera_taken_away_does_not_make_the_robot_faster(robot: Robot) -> None:
    robot.overrides = {"topics": {"depth": None}}
    assert bridge_config(robot).gate.has_depth
    robot.profile = RobotProfile.objects.get(slug="pmb2")
    assert not bridge_config(robot).gate.has_depth


def test_the_drive_topic_is_the_robots_own_choice(robot: Robot) -> None:
    assert bridge_config(robot).topics.drive.name == "/key_vel"
    robot.drive_topic = "/phone_vel"
    assert bridge_config(robot).topics.drive.name == "/phone_vel"
    assert robot_facts(robot).drive_topic == "/phone_vel"


def test_the_default_share_never_exceeds_the_largest(robot: Robot) -> None:
    robot.max_share = 0.2
    assert robot_facts(robot).default_share == 0.2


def test_the_digest_notices_edits_and_not_fences(robot: Robot) -> None:
    before = bridge_config(robot).digest()
    robot.fence = 99
    assert bridge_config(robot).digest() == before
    robot.profile.blind_mps = 0.25
    assert bridge_config(robot).digest() != before
