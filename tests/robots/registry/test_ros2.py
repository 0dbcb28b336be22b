"""Robots with ROS 2: registered by form, admin and REST, reached as their entry says, named once on pages."""

from __future__ import annotations

import re
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from robots.registry.models import Allowance, Robot, RobotProfile
from robots.registry.selectors import bridge_config, robot_facts
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.configuration.watchdog_config import watchdog_config
from tests.robots.registry.test_admin import filled
from tests.teleop.api.setup.test_registry import ask, headers_of

pytestmark = pytest.mark.django_db(transaction=True)
FIELDS_1 = {"master_uri", "advertised_address", "host_aliases"}
FIELDS_2 = {"domain_id", "discovery", "static_peers", "discovery_server", "namespace", "ros_setup"}


@pytest.fixture
def tiago_2(tiago: RobotProfile) -> RobotProfile:
    return RobotProfile.objects.get(slug="tiago-ros2")


@pytest.fixture
def second(tiago_2: RobotProfile) -> Robot:
    """A robot with ROS 2."""
    return Robot.objects.create(
        slug="second", name="Second", profile=tiago_2, domain_id=7, namespace="/tiago1"
    )


@pytest.fixture
def admin(client: Client, staff: User) -> Client:
    client.force_login(staff)
    return client


def shown(answer: Any, form: str = "adminform") -> set[str]:
    """Return the fields of a shown form by which a robot is reached."""
    found = answer.context[form]
    return {*(found.form if form == "adminform" else found).fields} & (FIELDS_1 | FIELDS_2)


def test_the_shipped_profile_is_the_same_robot_with_ros_2_names(tiago, tiago_2) -> None:
    assert (tiago.ros, tiago_2.ros) == (1, 2)
    assert tiago_2.topics["odometry"] == {
        "name": "/mobile_base_controller/odom",
        "type": "nav_msgs/msg/Odometry",
    }
    assert (tiago_2.topics["sonars"], tiago_2.footprint) == (tiago.topics["sonars"], tiago.footprint)
    config = bridge_config(Robot(slug="x", name="X", profile=tiago_2))
    actions = {"/play_motion2", "/tts_engine/tts", "/navigate_to_pose"}
    assert actions <= {*watchdog_config(config).actions}


def test_the_bridge_gets_the_domain_and_names_in_the_namespace(second: Robot, staff: User) -> None:
    Allowance.objects.create(
        profile=second.profile, what="publish", name="/words", type="std_msgs/msg/String"
    )
    Allowance.objects.create(robot=second, what="publish", name="/others", type="std_msgs/msg/String")
    second.static_peers, second.discovery = "10.68.0.1  tiago-42c", "off"
    second.full_clean()
    config = bridge_config(second)
    assert config.ros == Ros2(7, "off", ("10.68.0.1", "tiago-42c"), namespace="/tiago1")
    assert (config.topics.drive.name, config.topics.drive.type) == (
        "/tiago1/key_vel",
        "geometry_msgs/msg/Twist",
    )
    assert [*config.gate.scan_poses] == [scan.topic for scan in config.topics.scans] == ["/tiago1/scan_raw"]
    assert config.topics.navigation is not None and config.topics.navigation.plan == "/tiago1/plan"
    assert config.topics.arm is not None and config.topics.arm.links[0] == "arm_1_link"
    text = "std_msgs/msg/String"
    assert config.allowed == (
        Allowed("publish", "/others", text),
        Allowed("publish", "/tiago1/words", text),
    )
    assert robot_facts(second).drive_topic == "/tiago1/key_vel"


@pytest.mark.parametrize(
    ("type_name", "what"),
    [
        ("geometry_msgs/msg/Wrench", "publish"),
        ("trajectory_msgs/msg/JointTrajectory", "publish"),
        ("nav2_msgs/action/NavigateToPose_SendGoal", "call"),
        ("action_msgs/srv/CancelGoal", "call"),
        ("rcl_interfaces/srv/SetParameters", "call"),
        ("lifecycle_msgs/srv/ChangeState", "call"),
    ],
)
def test_ways_around_the_chain_are_denied_by_types_of_ros_2(second: Robot, type_name, what) -> None:
    with pytest.raises(ValidationError):
        Allowance(robot=second, what=what, name="/harmless", type=type_name).full_clean()


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("static_peers", "10.68.0.1, tiago", "'10.68.0.1,' is neither an IP address"),
        ("static_peers", "0.0.0.0", "is the address of no computer"),  # noqa: S104
        ("discovery_server", "10.68.0.1", "is not host:port, such as 10.68.0.1:11811"),
        ("discovery_server", "10.68.0.1:99999", "is not host:port"),
        ("namespace", "tiago1", "is not a namespace such as /tiago1"),
        ("ros_setup", "setup.bash", "is not a full path such as /opt/ros/jazzy/setup.bash"),
        ("domain_id", 102, "less than or equal to 101"),
        ("discovery", "everywhere", "is not a valid choice"),
    ],
)
def test_a_wrong_entry_names_its_field(second: Robot, field: str, value: Any, said: str) -> None:
    setattr(second, field, value)
    with pytest.raises(ValidationError) as caught:
        second.full_clean()
    assert [*caught.value.message_dict] == [field]
    assert said in caught.value.message_dict[field][0]


def test_two_robots_whose_topics_are_the_same_are_refused(second: Robot) -> None:
    twin = Robot(slug="twin", name="Other", profile=second.profile, domain_id=7, namespace="/tiago1")
    with pytest.raises(ValidationError) as caught:
        twin.full_clean()
    assert "Second is in this domain already" in caught.value.message_dict["domain_id"][0]
    for changes in ({"namespace": "/tiago2"}, {"domain_id": 8}, {"enabled": False}):
        other = Robot(slug="twin", name="Other", profile=second.profile, domain_id=7, namespace="/tiago1")
        for name, value in changes.items():
            setattr(other, name, value)
        other.full_clean()


def test_a_profile_has_types_of_its_own_ros_only(tiago_2: RobotProfile) -> None:
    tiago_2.drive_type = "geometry_msgs/Twist"
    with pytest.raises(ValidationError) as caught:
        tiago_2.full_clean()
    assert "'geometry_msgs/Twist' is not understood here, only geometry_msgs/msg/Twist" in str(caught.value)


def test_programs_register_a_robot_in_its_domain(robot: Robot, tiago_2, staff: User) -> None:
    mine = headers_of(staff)
    asked = {"name": "Nine", "profile": "tiago-ros2", "domain_id": 9, "discovery": "localhost"}
    wrong = ask("post", "/registry", mine, {**asked, "discovery_server": "nowhere"})
    assert (wrong.status_code, "discovery_server" in wrong.json()["detail"]) == (400, True)
    assert ask("post", "/registry", mine, {**asked, "domain_id": 102}).status_code == 400
    made = ask("post", "/registry", mine, asked)
    assert made.status_code == 201, made.content
    entry = made.json()
    assert (entry["ros"], entry["domain_id"], entry["discovery"]) == (2, 9, "localhost")
    seen = ask("get", "/registry/nine", mine)["ETag"]
    moved = ask("patch", "/registry/nine", mine, {"domain_id": 10}, **{"If-Match": seen})
    assert (moved.status_code, Robot.objects.get(slug="nine").domain_id) == (200, 10)
    without_master = ask("post", "/registry", mine, {"name": "Ten", "profile": robot.profile.slug})
    assert (without_master.status_code, "master_uri" in without_master.json()["detail"]) == (400, True)


def test_the_admin_shows_the_fields_of_the_profiles_ros(admin: Client, robot: Robot, second: Robot) -> None:
    assert shown(admin.get(reverse("admin:robots_robot_change", args=[robot.pk]))) == FIELDS_1
    assert shown(admin.get(reverse("admin:robots_robot_change", args=[second.pk]))) == FIELDS_2
    assert shown(admin.get(reverse("admin:robots_robot_add"))) == FIELDS_1
    assert shown(admin.get(f"{reverse('admin:robots_robot_add')}?profile={second.profile_id}")) == FIELDS_2
    assert 'data-ros2="' in admin.get(reverse("admin:robots_robot_add")).content.decode()
    export = {"action": "export_robots", "_selected_action": [str(second.pk)]}
    assert admin.post(reverse("admin:robots_robot_changelist"), export).json()[0]["domain_id"] == 7


def test_another_ros_asks_again_and_saves_nothing_before(admin: Client, robot: Robot, tiago_2) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    chosen = filled(admin, url, profile=tiago_2.pk, name="Renamed")
    again = admin.post(url, chosen | {"_reached": "1"})
    form = again.context["adminform"].form
    assert (shown(again), form.errors) == (FIELDS_2, {})
    assert (form["name"].value(), form["domain_id"].value(), form["discovery"].value()) == (
        "Renamed",
        0,
        "subnet",
    )
    unasked = admin.post(url, chosen)  # without a script
    assert {*unasked.context["adminform"].form.errors} == {"domain_id", "discovery"}
    robot.refresh_from_db()
    assert robot.profile.ros == 1
    assert admin.post(url, chosen | {"domain_id": "7", "discovery": "off"}).status_code == 302
    robot.refresh_from_db()
    assert bridge_config(robot).ros == Ros2(7, "off")
    back = filled(admin, url, profile=RobotProfile.objects.get(slug="tiago").pk)
    assert {*admin.post(url, back).context["adminform"].form.errors} == {"master_uri"}


def test_the_first_robot_may_have_ros_2(admin: Client, tiago_2: RobotProfile) -> None:
    chosen = {"name": "First", "profile": str(tiago_2.pk), "master_uri": ""}
    again = admin.post("/setup/robot/", chosen | {"_reached": "1"})
    assert (shown(again, "form"), again.context["form"].errors) == ({"domain_id", "discovery"}, {})
    page = again.content.decode()
    assert 'name="domain_id"' in page and "js/lib/reached_fields" in page
    pmb2_2 = RobotProfile.objects.get(slug="pmb2-ros2")
    assert f'data-ros2="{" ".join(map(str, sorted([pmb2_2.pk, tiago_2.pk])))}"' in page
    assert (
        "Location"
        not in admin.post("/setup/robot/", chosen | {"domain_id": "102", "discovery": "off"}).headers
    )
    made = admin.post("/setup/robot/", chosen | {"domain_id": "3", "discovery": "localhost"})
    assert made.headers["Location"] == "/setup/robot/first/"
    assert bridge_config(Robot.objects.get()).ros == Ros2(3, "localhost")


@pytest.mark.parametrize(
    "address",
    ["/", "/robots/second/", "/?wall", "/plan/", "/robots/second/report/", "/status/", "/today/"],
)
def test_a_page_says_ros_2_once_beside_the_robots_name(admin: Client, second: Robot, address: str) -> None:
    page = admin.get(address).content.decode()
    assert page.count("ROS 2") == 1
    assert re.search(r'Second(</a>|</h[12]>)?\s*<span class="badge">ROS 2</span>', page)


def test_the_admins_list_says_ros_2_once_beside_the_robots_name(admin: Client, second: Robot) -> None:
    page = admin.get(reverse("admin:robots_robot_changelist")).content.decode()
    rows, filters = page.split('id="changelist-filter"')
    assert rows.count("ROS 2") == 1
    assert re.search(r'>Second\s*<span class="badge">ROS 2</span>\s*</a>', rows)
    assert re.findall(r"[\w ()-]*ROS 2[)]?", filters) == ["PAL PMB-2 (ROS 2)", "PAL TIAGo (ROS 2)"]
