"""Findings of the robot check, each with advice on what to do."""

from __future__ import annotations

import errno
import subprocess
from typing import Any
from unittest import mock

import msgspec
import pytest

from fleet.accounts.models import User
from robots.check.judgement import judge
from robots.check.plan import plan_for
from robots.check.results import Check
from robots.check.robot_check import run_checks
from robots.registry.models import Robot, RobotProfile
from robots.registry.selectors import bridge_config
from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.processes.probe_findings import (
    CallbackFound,
    DescriptionFound,
    DriveFound,
    Findings,
    HostFound,
    Misfit,
    TopicFound,
)


@pytest.fixture
def config(robot: Robot) -> BridgeConfig:
    return bridge_config(robot)


@pytest.fixture
def well(config: BridgeConfig) -> Findings:
    """Return the findings of a robot without faults."""
    topics = [
        TopicFound(asked.what, ["/base"], asked.type, "abc", "abc", 1, asked.frames, 0.01)
        for asked in plan_for(config).listened
    ]
    return Findings(
        hosts=[HostFound("tiago-42c", 9, "10.68.0.1")],
        callback=CallbackFound("10.68.0.2", True, "10.68.0.2"),
        topics=topics,
        drive=DriveFound(["/fleet_bridge"], ["/twist_mux"], "geometry_msgs/Twist"),
    )


def answer(config: BridgeConfig, findings: Findings, name: str) -> Check:
    (found,) = (check for check in judge(config, findings) if check.name == name)
    return found


def with_topic(findings: Findings, what: str, **changes: Any) -> Findings:
    topics = [
        msgspec.structs.replace(topic, **changes) if topic.what == what else topic
        for topic in findings.topics
    ]
    return msgspec.structs.replace(findings, topics=topics)


def test_a_robot_that_is_well_gets_nothing_but_ok(config: BridgeConfig, well: Findings) -> None:
    assert {check.level for check in judge(config, well)} == {"ok"}
    assert all(not check.advice for check in judge(config, well))


def test_a_sonar_with_a_close_echo_is_named_with_the_remedy(config: BridgeConfig, well: Findings) -> None:
    what = f"sonars {config.topics.sonars[0].topic}"
    ranges = {"base_sonar_01_link": 0.4, "base_sonar_02_link": 0.05}
    check = answer(config, with_topic(well, what, ranges=ranges), what)
    assert check.level == "warn"
    assert check.text == "/sonar_base: base_sonar_02_link reports 0.05 m."
    assert "clean the sensor" in check.advice and "from the profile" in check.advice


@pytest.mark.parametrize(
    ("found", "level", "says"),
    [
        (DescriptionFound(), "ok", "all links and joints"),
        (
            DescriptionFound(["gripper_grasping_frame"], ["arm_7_joint"]),
            "warn",
            "gripper_grasping_frame and arm_7_joint",
        ),
        (DescriptionFound(error="there is none"), "warn", "there is none"),
        (DescriptionFound(unplaced=["arm_3_link"]), "warn", "does not say where arm_3_link is"),
    ],
)
def test_links_missing_in_the_description_are_named(
    config: BridgeConfig, well: Findings, found: DescriptionFound, level: str, says: str
) -> None:
    description = answer(config, msgspec.structs.replace(well, description=found), "description of the arm")
    assert description.level == level and says in description.text
    assert bool(description.advice) == (level != "ok")


FREE_LINKS = "".join(f"<link name='free{number}'/>" for number in range(5))


@pytest.mark.parametrize(
    ("text", "level", "says"),
    [
        ("<robot><link name='base'/></robot>", "ok", "as a whole"),
        (f"<robot><link name='base'/>{FREE_LINKS}</robot>", "warn", "link 'free0' hangs on no joint"),
        (f"<robot><link name='base'/>{FREE_LINKS}</robot>", "warn", "; 2 more (3D view: notes)."),
        ("<sdf/>", "warn", "is no <robot>"),
    ],
)
def test_parts_of_a_description_that_are_left_out_are_named(
    config: BridgeConfig, well: Findings, text: str, level: str, says: str
) -> None:
    found = msgspec.structs.replace(well, description=DescriptionFound(text=text))
    description = answer(config, found, "description")
    assert description.level == level and says in description.text


def test_without_a_master_there_is_one_answer(config: BridgeConfig) -> None:
    (only,) = judge(config, Findings(master_error="No ROS master answers."))
    assert (only.level, only.text) == ("fail", "No ROS master answers.")
    assert config.ros.master_uri in only.advice


@pytest.fixture
def config_2(robot: Robot) -> BridgeConfig:
    robot.profile = RobotProfile.objects.get(slug="tiago-ros2")
    robot.domain_id = 7
    return bridge_config(robot)


@pytest.fixture
def well_2(config_2: BridgeConfig) -> Findings:
    """Return the findings of a robot with ROS 2 without faults."""
    topics = [
        TopicFound(asked.what, ["/base"], asked.type, "", "", 1, asked.frames, 0.01)
        for asked in plan_for(config_2).listened
    ]
    return Findings(topics=topics, drive=DriveFound(["/fleet_bridge"], ["/twist_mux"], None))


def test_a_robot_with_ros_2_has_a_domain_and_no_master(config_2: BridgeConfig, well_2: Findings) -> None:
    checks = list(judge(config_2, well_2))
    assert {check.level for check in checks} == {"ok"}
    assert checks[0].text == "Nodes answer in domain 7."
    assert not any("master" in check.text or "names" in check.name for check in checks)
    (only,) = judge(config_2, Findings(master_error="No node answers in domain 7."))
    assert (only.level, only.text) == ("fail", "No node answers in domain 7.")
    assert "ROS_DOMAIN_ID should be 7" in only.advice and "static peers" in only.advice


def test_two_robots_with_the_same_names_in_a_domain_are_found(config_2, well_2) -> None:
    found = with_topic(well_2, "odometry", publishers=["/base", "/base"])
    check = answer(config_2, found, "two robots")
    assert (check.level, check.text) == (
        "fail",
        "/base and /base publish odometry: two robots seem to be in this domain.",
    )


def test_a_listener_of_another_type_beside_the_right_one_is_named(config_2, well_2) -> None:
    stamped = Misfit("/rviz", "type", "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
    drive = DriveFound([], ["/twist_mux"], None, [stamped])
    check = answer(config_2, msgspec.structs.replace(well_2, drive=drive), "drive")
    assert (check.level, check.advice) == ("warn", "Correct the profile’s type, or its own.")
    assert "it asks for type geometry_msgs/msg/TwistStamped, the console offers" in check.text


def test_a_namespace_that_the_registry_lacks_is_all_that_is_said(config_2, well_2) -> None:
    _, check = judge(config_2, msgspec.structs.replace(well_2, namespaces=["/tiago1"]))
    assert (check.name, check.level, "in the namespace /tiago1." in check.text) == ("namespace", "fail", True)


def test_two_nodes_of_one_name_may_be_two_robots(config_2, well_2) -> None:
    check = answer(config_2, msgspec.structs.replace(well_2, twins=["/twist_mux"]), "two robots")
    assert (check.level, "Several nodes are called /twist_mux" in check.text) == ("warn", True)


@pytest.mark.parametrize(("subscribers", "level"), [([], "fail"), (["/base"], "warn")])
def test_a_listener_that_asks_for_old_velocities_is_named(config_2, well_2, subscribers, level) -> None:
    refused = [Misfit("/twist_mux", "durability", "volatile", "transient local")]
    drive = DriveFound([], subscribers, None, refused)
    check = answer(config_2, msgspec.structs.replace(well_2, drive=drive), "drive")
    assert (check.level, check.text) == (
        level,
        "/twist_mux gets nothing on /key_vel: "
        "it asks for durability transient local, the console offers volatile.",
    )
    assert check.advice.startswith("Set the durability of its subscription to volatile")


def test_a_listener_with_another_version_of_the_type_is_named(config_2, well_2) -> None:
    drive = DriveFound([], ["/twist_mux"], None, differing=["/twist_mux"])
    check = answer(config_2, msgspec.structs.replace(well_2, drive=drive), "drive")
    assert check.level == "warn" and "/twist_mux listens to /key_vel, but" in check.text


def test_a_clock_that_lags_keeps_no_robot_from_driving(config_2, well_2) -> None:
    """A velocity with a stamp has the stamp zero then, which a controller takes as its own time."""
    stamped = Topic("/cmd_vel", "geometry_msgs/msg/TwistStamped")
    topics = msgspec.structs.replace(config_2.topics, drive=stamped)
    late = with_topic(well_2, "odometry", skew_s=-2.0)
    late = msgspec.structs.replace(late, topics=late.topics[:1])
    config = msgspec.structs.replace(config_2, topics=msgspec.structs.replace(topics, scans=[]))
    check = next(each for each in judge(config, late) if each.name == "clock")
    assert (check.level, "2.0 s behind" in check.text) == ("warn", True)


@pytest.mark.parametrize(
    ("there", "level", "says"),
    [
        ({"/say"}, "ok", "It takes the place of /tts_engine/tts."),
        (
            {"/say", "/skill/say"},
            "warn",
            "no /tts_engine/tts, but /skill/say and /say.",
        ),
        ({"/tts_engine/tts", "/say"}, "ok", "/tts_engine/tts ("),
        (set(), "warn", "No node publishes /tts_engine/tts"),
    ],
)
def test_the_name_that_a_robot_has_in_place_of_another_is_said(config_2, well_2, there, level, says) -> None:
    names = {f"{name}/_action/feedback" for name in there}
    topics = [
        msgspec.structs.replace(found, publishers=["/base"] if asked.topic in names else [])
        if asked.what == "speech"
        else found
        for asked, found in zip(plan_for(config_2).listened, well_2.topics, strict=True)
    ]
    check = answer(config_2, msgspec.structs.replace(well_2, topics=topics), "speech")
    assert (check.level, says in check.text, bool(check.advice)) == (level, True, level != "ok")


def test_velocities_of_another_type_than_in_the_profile_are_said(config_2, well_2) -> None:
    drive = DriveFound([], ["/twist_mux"], None, takes="geometry_msgs/msg/TwistStamped")
    check = answer(config_2, msgspec.structs.replace(well_2, drive=drive), "drive")
    assert (check.level, check.text) == (
        "ok",
        "/twist_mux listens to /key_vel (geometry_msgs/msg/TwistStamped). "
        "The profile has geometry_msgs/msg/Twist: the console follows the robot.",
    )


def test_a_type_without_its_package_is_named(config_2, well_2) -> None:
    check = answer(config_2, with_topic(well_2, "odometry", our_md5=None), "odometry")
    assert check.text == "The console does not know the type nav_msgs/msg/Odometry."


def test_a_name_that_does_not_resolve_here_asks_for_an_alias(config: BridgeConfig, well: Findings) -> None:
    lost = msgspec.structs.replace(well, hosts=[HostFound("tiago-42c", 9)])
    check = answer(config, lost, "names, robot to console")
    assert check.level == "fail"
    assert "call themselves tiago-42c" in check.text
    assert '{"tiago-42c": "10.68.0.1"}' in check.advice


def test_a_name_with_a_wrong_address_is_reported(config: BridgeConfig, well: Findings) -> None:
    lost = msgspec.structs.replace(well, hosts=[HostFound("tiago-42c", 9, "10.68.0.9", "timed out")])
    check = answer(config, lost, "names, robot to console")
    assert check.text == "Nodes on tiago-42c (10.68.0.9: timed out) cannot be reached."


@pytest.mark.parametrize(
    ("advertised", "advice"),
    [
        ("127.0.0.1", "Set the robot’s advertised address to 10.68.0.2."),
        ("10.68.0.2", "Does a firewall on this computer keep the robot out?"),
    ],
)
def test_a_robot_that_cannot_call_back_names_the_address(
    config: BridgeConfig, well: Findings, advertised: str, advice: str
) -> None:
    deaf = msgspec.structs.replace(well, callback=CallbackFound(advertised, False, "10.68.0.2"))
    check = answer(config, deaf, "names, console to robot")
    assert (check.level, check.advice) == ("fail", advice)


@pytest.mark.parametrize(("skew_s", "said"), [(3600.0, "3600.0 s ahead of"), (-2.04, "2.0 s behind")])
def test_clocks_that_disagree_are_a_warning(
    config: BridgeConfig, well: Findings, skew_s: float, said: str
) -> None:
    topics = [msgspec.structs.replace(topic, skew_s=skew_s) for topic in well.topics]
    check = answer(config, msgspec.structs.replace(well, topics=topics), "clock")
    assert check.level == "warn"
    assert said in check.text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"publishers": []}, "No node publishes"),
        ({"error": "/base: timed out"}, "cannot be read: /base: timed out"),
        ({"type": "std_msgs/String"}, "is a std_msgs/String, not a"),
        ({"our_md5": None}, "does not know the type"),
        ({"md5": "def"}, "has md5 def on the robot and abc here"),
        ({"messages": 0}, "no message came"),
    ],
)
def test_errors_of_a_topic_are_explained_with_advice(
    config: BridgeConfig, well: Findings, changes: dict[str, Any], said: str
) -> None:
    for what, level in (
        ("odometry", "fail"),
        ("scan /scan_raw", "fail"),
        ("camera /xtion/rgb/image_raw/compressed", "warn"),
        ("map", "warn"),
    ):
        check = answer(config, with_topic(well, what, **changes), what)
        assert (check.level, bool(check.advice)) == (level, True)
        assert said in check.text


def test_a_battery_may_be_silent(config: BridgeConfig, well: Findings) -> None:
    assert answer(config, with_topic(well, "battery", messages=0), "battery").level == "ok"


def test_a_sonar_that_is_missing_among_others_is_named(config: BridgeConfig, well: Findings) -> None:
    some = with_topic(well, "sonars /sonar_base", frames=["base_sonar_01_link", "base_sonar_03_link"])
    check = answer(config, some, "sonars /sonar_base")
    assert check.text == (
        "/sonar_base has no messages from base_sonar_02_link, only from base_sonar_01_link and base_sonar_03_link."
    )


@pytest.mark.parametrize(
    ("found", "name", "level", "said"),
    [
        (DriveFound([], [], "geometry_msgs/Twist"), "drive", "fail", "No node listens to /key_vel"),
        (DriveFound([], ["/mux"], "std_msgs/Bool"), "drive", "fail", "is a std_msgs/Bool"),
        (
            DriveFound(["/fleet_bridge", "/rogue"], ["/mux"], None),
            "other drivers",
            "warn",
            "/rogue also publishes",
        ),
        (DriveFound(["/fleet_bridge"], ["/mux"], None), "other drivers", "ok", "No other node"),
    ],
)
def test_the_drive_topic_has_a_listener_and_one_writer(
    config: BridgeConfig, well: Findings, found: DriveFound, name: str, level: str, said: str
) -> None:
    check = answer(config, msgspec.structs.replace(well, drive=found), name)
    assert check.level == level
    assert said in check.text


def test_a_voice_that_takes_plain_texts_is_not_listened_to(robot: Robot) -> None:
    robot.overrides = {"topics": {"speech": {"name": "/say", "type": "std_msgs/String"}}}
    listened = plan_for(bridge_config(robot)).listened
    assert "speech" not in {topic.what for topic in listened}
    assert "motions" in {topic.what for topic in listened}


def test_a_wrong_entry_in_the_registry_is_the_first_answer(robot: Robot) -> None:
    robot.overrides = {"topics": {"odometry": None}}
    (only,) = run_checks(robot)
    assert (only.name, only.level) == ("registry", "fail")
    assert "odometry" in only.text


def test_a_full_disk_is_an_answer_too(robot: Robot) -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    with mock.patch("robots.check.robot_check.ros_environment", autospec=True, side_effect=full):
        (only,) = run_checks(robot)
    assert (only.name, only.level) == ("host aliases", "fail")
    assert "No space left on device" in only.text


def test_a_probe_that_hangs_is_given_up(robot: Robot) -> None:
    hanging = mock.patch(
        "robots.check.robot_check.subprocess.run",
        autospec=True,
        side_effect=subprocess.TimeoutExpired("probe", 20),
    )
    with hanging:
        (only,) = run_checks(robot)
    assert (only.name, only.level) == ("probe", "fail")


def test_a_bridge_on_another_computer_asks_for_the_check_there(robot: Robot, well: Findings) -> None:
    robot.bridge_address = "wss://bridges.lab:7443"
    deaf = msgspec.structs.replace(well, callback=CallbackFound("10.68.0.3", False, "10.68.0.2"))
    done = subprocess.CompletedProcess([], 0, msgspec.json.encode(deaf))
    with mock.patch("robots.check.robot_check.subprocess.run", autospec=True, return_value=done):
        first, *others = run_checks(robot)
    assert (first.level, {check.level for check in others}) == ("warn", {"ok"})
    assert "wss://bridges.lab:7443" in first.text
    assert f"sudo script/manage check_robot {robot.slug}" in first.advice


class TestPage:
    """/robots/<slug>/check/"""

    ADDRESS = "/robots/tiago-1/check/"

    @pytest.fixture(autouse=True)
    def answers(self) -> Any:
        answers = [Check("master", "fail", "No ROS master answers.", "Is the robot on?")]
        with mock.patch("robots.check.views.run_checks", autospec=True, return_value=answers) as asked:
            yield asked

    def test_everybody_who_sees_the_robot_reads_every_answer(self, observer: User, signed_in: Any) -> None:
        page = signed_in(observer).get(self.ADDRESS).content.decode()
        assert "No ROS master answers." in page
        assert "Is the robot on?" in page

    def test_to_a_stranger_the_robot_does_not_exist(
        self, robot: Robot, stranger: User, signed_in: Any, answers: mock.Mock
    ) -> None:
        assert signed_in(stranger).get(self.ADDRESS).status_code == 404
        assert not answers.called

    def test_signed_out_people_are_sent_to_the_sign_in(
        self, robot: Robot, client: Any, answers: mock.Mock
    ) -> None:
        assert client.get(self.ADDRESS, headers={"accept": "text/html"}).status_code == 302
        assert not answers.called
