"""The allow-list: valid entries, their robots, and the same list for bridge and pages."""

from __future__ import annotations

from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.registry.configuration.robot_config import profile_topics
from robots.registry.models import Allowance, Robot, RobotProfile, Role
from robots.registry.selectors import allowed_on, bridge_config
from robots.registry.services import entry_delete, entry_save
from robots.shared.configuration.bridge_config import Allowed, Topic
from robots.shared.configuration.denylist import why_denied
from teleop.control.selectors import robot_entry
from tests.robots.registry.test_admin import filled

pytestmark = pytest.mark.django_db

NOTES = {"what": "publish", "name": "/demo/notes", "type": "std_msgs/String"}


def allow(owner: Robot | RobotProfile, staff: User, **fields: Any) -> Allowance:
    entry = Allowance(**{"robot" if isinstance(owner, Robot) else "profile": owner, **NOTES, **fields})
    entry_save(entry=entry, actor=staff)
    return entry


def complaint(owner: Robot | RobotProfile, staff: User, **fields: Any) -> dict[str, list[str]]:
    with pytest.raises(ValidationError) as caught:
        allow(owner, staff, **fields)
    messages: dict[str, list[str]] = caught.value.message_dict
    return messages


# --- forbidden entries ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "/key_vel",  # the robot's own drive topic
        "/cmd_vel",
        "/base/cmdVel",
        "/nav_vel",
        "/mobile_base_controller/cmd_vel",
        "/arm_controller/command",
        "/joy",
        "/joy_priority",
        "/pause_navigation",
        "/emergency_brake",
        "/eStop",
        "/tts/goal",
        "/tts/cancel",
        "/move_base_simple/goal",
        "/scan",
        "/scan_raw",
        "/tiago_2/scan2",
        "/sonar_base",
        "/xtion/depth_registered/points",
        "/mobile_base_controller/odom",
        "/joint_states",
        "/tf",
        "/tf_static",
        "/clock",
        "/power/battery_level",
        "/power/is_emergency",
    ],
)
def test_no_allow_list_bypasses_or_blinds_the_chain(tiago: RobotProfile, name: str) -> None:
    assert why_denied("publish", name, "std_msgs/String", profile_topics(tiago))


@pytest.mark.parametrize(
    "type_name",
    [
        "geometry_msgs/Twist",
        "geometry_msgs/TwistStamped",
        "trajectory_msgs/JointTrajectory",
        "pal_interaction_msgs/TtsActionGoal",
        "play_motion_msgs/PlayMotionActionResult",
        "actionlib_msgs/GoalID",
        "actionlib_msgs/GoalStatusArray",
        "sensor_msgs/LaserScan",
        "sensor_msgs/Range",
        "sensor_msgs/PointCloud2",
        "sensor_msgs/Image",
        "sensor_msgs/JointState",
        "sensor_msgs/BatteryState",
        "sensor_msgs/Joy",
        "nav_msgs/Odometry",
        "tf2_msgs/TFMessage",
        "tf/tfMessage",
        "rosgraph_msgs/Clock",
    ],
)
def test_forbidden_types_are_refused_under_any_topic_name(tiago: RobotProfile, type_name: str) -> None:
    assert why_denied("publish", "/demo/notes", type_name, profile_topics(tiago))


def test_topics_of_the_description_are_never_published(
    tiago: RobotProfile,
) -> None:
    tiago.topics["battery"] = {"name": "/juice", "type": "std_msgs/Float32"}
    assert why_denied("publish", "/juice", "std_msgs/Float32", profile_topics(tiago))
    assert why_denied("publish", "/squash", "std_msgs/Float32", profile_topics(tiago)) is None


@pytest.mark.parametrize(
    ("what", "name", "type_name", "use"),
    [
        ("publish", "/demo/notes", "std_msgs/String", ""),
        ("publish", "/demo/place", "geometry_msgs/PoseStamped", ""),
        ("publish", "/initialpose", "geometry_msgs/PoseWithCovarianceStamped", ""),
        ("call", "/move_base/clear_costmaps", "std_srvs/Empty", ""),
        ("call", "/play_motion/list_motions", "", ""),
        ("set", "/demo/greeting", "", ""),
        ("choose", "/phone_vel", "geometry_msgs/Twist", "drive"),
        ("choose", "/nav_vel", "geometry_msgs/Twist", "drive"),
        ("choose", "/tts_2", "pal_interaction_msgs/TtsAction", "speech"),
        ("choose", "/play_motion_2", "play_motion_msgs/PlayMotionAction", "motions"),
    ],
)
def test_much_else_may_be_on_it(tiago: RobotProfile, what: str, name: str, type_name: str, use: str) -> None:
    assert why_denied(what, name, type_name, profile_topics(tiago), use) is None


@pytest.mark.parametrize("name", ["/joy_vel", "/rviz_joy_vel", "/tab_vel", "/mobile_base_controller/cmd_vel"])
def test_input_goes_nowhere_that_wins_over_joystick_and_locks(tiago: RobotProfile, name: str) -> None:
    assert why_denied("choose", name, "geometry_msgs/Twist", profile_topics(tiago), "drive")


@pytest.mark.parametrize(
    ("what", "name", "type_name"),
    [
        ("call", "/controller_manager/switch_controller", ""),
        ("call", "/demo/harmless", "dynamic_reconfigure/Reconfigure"),
        ("call", "/laser/disable", "std_srvs/Empty"),
        ("set", "/robot_description", ""),
        ("set", "/use_sim_time", ""),
        ("set", "/twist_mux/topics", ""),
        ("set", "/play_motion/motions/wave/points", ""),
    ],
)
def test_nor_is_the_chain_undone_by_a_service_or_a_parameter(
    tiago: RobotProfile, what: str, name: str, type_name: str
) -> None:
    assert why_denied(what, name, type_name, profile_topics(tiago))


# --- entries -------------------------------------------------------------------------------------


def test_it_is_empty_by_default(robot: Robot) -> None:
    assert bridge_config(robot).allowed == ()


@pytest.mark.parametrize(
    ("fields", "field", "said"),
    [
        ({"name": "/scan"}, "name", "/scan can never be allowed: the gate uses scans and ranges."),
        ({"type": "geometry_msgs/Twist"}, "name", "velocities move the base"),
        ({"name": "demo/notes"}, "name", "Write a full ROS name"),
        ({"type": "String"}, "type", "Write package and type"),
        ({"type": "std_msgs/message/String"}, "type", "Write package and type"),
        ({"type": ""}, "type", "Publishing and calling need a type."),
        ({"what": "call", "type": ""}, "type", "Publishing and calling need a type."),
        ({"what": "set"}, "type", "A parameter has no type"),
        ({"name": "/demo/notes\n"}, "name", "it is not a full ROS name"),
        ({"use": "drive"}, "use", "Only for “choose”"),
        ({"what": "choose", "name": "/phone_vel", "type": ""}, "use", "Choose the input that goes there."),
        (
            {"what": "choose", "use": "drive", "name": "/phone_vel"},
            "name",
            "its type is std_msgs/String, but input for drive needs geometry_msgs/Twist",
        ),
    ],
)
def test_a_wrong_entry_is_refused_at_its_field(
    robot: Robot, staff: User, fields: dict[str, Any], field: str, said: str
) -> None:
    messages = complaint(robot, staff, **fields)
    assert list(messages) == [field]
    assert said in messages[field][0]
    assert not robot.allowances.exists()


def test_types_may_have_the_names_of_ros2(robot: Robot, staff: User) -> None:
    allow(robot, staff, type="std_msgs/msg/String")
    assert bridge_config(robot).allowed[0].type == "std_msgs/msg/String"
    assert "velocities move the base" in str(complaint(robot, staff, type="geometry_msgs/msg/Twist"))


def test_a_missing_capability_cannot_be_chosen(staff: User) -> None:
    base = RobotProfile.objects.get(slug="pmb2")
    messages = complaint(base, staff, what="choose", use="speech", name="/tts", type="")
    assert "this robot takes no input for speech" in messages["name"][0]


def test_the_type_of_a_choice_is_the_robots(robot: Robot, staff: User) -> None:
    allow(robot, staff, what="choose", use="drive", name="/phone_vel", type="")
    assert allowed_on(robot) == (Allowed("choose", "/phone_vel", "geometry_msgs/Twist", "drive", "operator"),)


@pytest.mark.parametrize(("what", "type_name"), [("call", "std_srvs/Trigger"), ("set", "")])
def test_services_and_parameters_are_for_staff(robot: Robot, staff: User, what: str, type_name: str) -> None:
    assert allow(robot, staff, what=what, type=type_name, role=Role.OPERATOR).role == Role.STAFF


def test_services_that_clients_offer_have_the_role_of_their_entry(robot, staff):
    own = allow(robot, staff, what="call", name="/fleet/clients/add", type="lab_srvs/Add", role=Role.OPERATOR)
    assert own.role == Role.OPERATOR


def test_entries_are_recorded(tiago: RobotProfile, staff: User) -> None:
    entry = allow(tiago, staff)
    entry.role = Role.SUPERVISOR
    entry_save(entry=entry, actor=staff)
    entry_delete(entry=entry, actor=staff)
    made, changed, deleted = Record.objects.filter(kind__startswith="allowance.").order_by("id")
    assert (made.kind, made.parameters["profile"], made.parameters["name"]) == (
        "allowance.create",
        "tiago",
        "/demo/notes",
    )
    assert changed.parameters == {
        "profile": "tiago",
        "entry": "publish /demo/notes",
        "changes": [{"field": "role", "from": "operator", "to": "supervisor"}],
    }
    assert (deleted.kind, deleted.actor_id) == ("allowance.delete", str(staff.pk))


# --- entries of a robot --------------------------------------------------------------------------


def test_a_robots_own_entries_come_before_its_profiles(
    robot: Robot, other_robot: Robot, tiago: RobotProfile, staff: User
) -> None:
    allow(tiago, staff)
    allow(tiago, staff, name="/demo/more")
    allow(robot, staff, role=Role.STAFF)
    allow(other_robot, staff, name="/demo/else")
    assert [(entry.name, entry.role) for entry in allowed_on(robot)] == [
        ("/demo/more", "operator"),
        ("/demo/notes", "staff"),
    ]
    names = [entry.name for entry in allowed_on(other_robot)]
    assert names == ["/demo/else", "/demo/more", "/demo/notes"]


def test_bridge_and_pages_get_the_same_list(robot: Robot, staff: User) -> None:
    before = bridge_config(robot).digest()
    allow(robot, staff)
    known = robot_entry(robot.pk)
    assert known is not None
    assert known.allowed == bridge_config(robot).allowed == allowed_on(robot) != ()
    assert bridge_config(robot).digest() != before


def test_entries_forbidden_by_a_later_edit_are_left_out(robot: Robot, staff: User) -> None:
    allow(robot, staff)
    allow(robot, staff, what="choose", use="speech", name="/tts_2", type="")
    robot.overrides = {
        "topics": {"battery": {"name": "/demo/notes", "type": "std_msgs/Float32"}, "speech": None}
    }
    robot.save()
    assert allowed_on(robot) == ()


def test_a_robot_whose_entry_is_wrong_has_a_page_all_the_same(robot: Robot, staff: User) -> None:
    allow(robot, staff)
    Robot.objects.filter(pk=robot.pk).update(overrides={"topics": {"scans": []}})
    known = robot_entry(robot.pk)
    assert known is not None and known.allowed == ()


def test_languages_and_speech_are_in_the_description(robot: Robot) -> None:
    robot.overrides = {
        "topics": {
            "languages": ["it-IT"],
            "speech": {"name": "/robotsound", "type": "sound_play/SoundRequest"},
        }
    }
    robot.full_clean()
    topics = bridge_config(robot).topics
    assert (topics.languages, topics.speech) == (["it-IT"], Topic("/robotsound", "sound_play/SoundRequest"))
    robot.overrides = {"topics": {"languages": ["it-IT", "Italian"]}}
    with pytest.raises(ValidationError, match=r"languages\[1\]: 'Italian' is not a language code"):
        robot.full_clean()


# --- in the admin --------------------------------------------------------------------------------


@pytest.fixture
def admin(staff: User, signed_in: Any) -> Client:
    client: Client = signed_in(staff)
    return client


def entered(prefix: str = "allowances", **fields: Any) -> dict[str, Any]:
    """Return form fields that add one line of the allow-list on the page of its robot or profile."""
    entry = {**NOTES, "role": "operator", **fields}
    return {f"{prefix}-TOTAL_FORMS": 1, **{f"{prefix}-0-{name}": value for name, value in entry.items()}}


def test_the_list_is_edited_on_the_robots_page(admin: Client, robot: Robot, staff: User) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    assert admin.post(url, filled(admin, url, **entered())).status_code == 302
    assert robot.allowances.get().name == "/demo/notes"
    assert admin.post(url, filled(admin, url, **{"allowances-0-DELETE": "on"})).status_code == 302
    assert not robot.allowances.exists()
    kinds = Record.objects.filter(robot_id=robot.pk, actor_id=str(staff.pk)).order_by("id")
    assert [record.kind for record in kinds] == ["allowance.create", "allowance.delete"]


def test_and_on_the_profiles(admin: Client, tiago: RobotProfile) -> None:
    url = reverse("admin:robots_robotprofile_change", args=[tiago.pk])
    sent = filled(admin, url, **entered(what="choose", use="drive", name="/phone_vel", type=""))
    assert admin.post(url, sent).status_code == 302
    assert tiago.allowances.get().type == "geometry_msgs/Twist"


def test_a_new_robot_may_have_one_at_once(admin: Client, tiago: RobotProfile) -> None:
    url = reverse("admin:robots_robot_add")
    robot = {"name": "New", "slug": "new", "profile": tiago.pk, "master_uri": "http://10.0.0.1:11311"}
    assert admin.post(url, filled(admin, url, **robot, **entered())).status_code == 302
    assert Robot.objects.get(slug="new").allowances.count() == 1


def test_an_entry_that_no_list_admits_is_refused_with_reason(admin: Client, robot: Robot) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    page = admin.post(url, filled(admin, url, **entered(name="/tf", type="std_msgs/String"))).content.decode()
    assert "/tf can never be allowed: the gate uses frames and clocks." in page
    assert not robot.allowances.exists()


def test_a_name_is_listed_once(admin: Client, robot: Robot, staff: User) -> None:
    allow(robot, staff)
    url = reverse("admin:robots_allowance_add")
    page = admin.post(url, {**NOTES, "robot": robot.pk, "role": "staff"}).content.decode()
    assert "already exists" in page
    assert robot.allowances.count() == 1


def test_the_list_says_which_entries_count_not_and_why(
    admin: Client, robot: Robot, tiago: RobotProfile, staff: User
) -> None:
    allow(robot, staff)
    allow(tiago, staff, what="call", name="/demo/lamp", type="std_srvs/Trigger")
    assert "frames and clocks" not in admin.get(reverse("admin:robots_allowance_changelist")).content.decode()
    # An older version of the console allowed this
    Allowance.objects.filter(what="publish").update(name="/tf")
    Allowance.objects.filter(what="call").update(type="")
    page = admin.get(reverse("admin:robots_allowance_changelist")).content.decode()
    assert "the gate uses frames and clocks" in page
    assert "it names no type" in page
