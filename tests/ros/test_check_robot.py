"""``manage.py check_robot`` with a real rosmaster."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import StringIO
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
import rospy
from django.core.management import call_command
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range
from std_msgs.msg import Bool, Header, String

from robots.registry.models import Robot
from tests.processes import REPOSITORY, free_port
from tests.ros.support import Master, RosClient, SimulatorProcess

pytestmark = pytest.mark.django_db

ODOMETRY = "/mobile_base_controller/odom"

# A robot whose nodes use a host name that no other computer knows.
NAMED_ROBOT = """
import os, sys
import robots.bridge.ros
import rospy
from nav_msgs.msg import Odometry
rospy.init_node("base", disable_signals=True, disable_rosout=True)
publisher = rospy.Publisher(sys.argv[1], Odometry, queue_size=1)
print("ready", flush=True)
while not rospy.is_shutdown():
    message = Odometry()
    message.header.stamp = rospy.Time.now()
    publisher.publish(message)
    rospy.sleep(0.02)
"""


@pytest.fixture
def fresh_master(tmp_path: Any) -> Iterator[Master]:
    """A master that no other test has used."""
    master = Master(tmp_path).start()
    yield master
    master.stop()


def check(robot: Robot, master: Master, **changes: Any) -> dict[str, dict[str, str]]:
    """Run the command; return its answers by name."""
    Robot.objects.filter(pk=robot.pk).update(
        **{"master_uri": master.uri, "advertised_address": "127.0.0.1", **changes}
    )
    out = StringIO()
    try:
        call_command("check_robot", robot.slug, "--json", stdout=out)
        failed = False
    except SystemExit as ended:
        failed = ended.code == 1
    answers = {answer["name"]: answer for answer in json.loads(out.getvalue())}
    assert failed == any(answer["level"] == "fail" for answer in answers.values())
    return answers


@contextmanager
def odometry_from(client: RosClient, ahead_s: float) -> Iterator[None]:
    """Publish odometry with stamps of a clock that is `ahead_s` ahead."""
    ending = threading.Event()

    def publish(publisher: rospy.Publisher) -> None:
        while not ending.wait(0.02):
            message = Odometry()
            message.header.stamp = rospy.Time.now() + rospy.Duration.from_sec(ahead_s)
            publisher.publish(message)

    with client.speak(ODOMETRY, Odometry, listeners=0) as publisher:
        thread = threading.Thread(target=publish, args=(publisher,))
        thread.start()
        try:
            yield
        finally:
            ending.set()
            thread.join()


def test_the_simulated_tiago_is_ready_to_be_driven(
    robot: Robot, rosmaster: Master, simulator: Callable[..., SimulatorProcess]
) -> None:
    running = simulator(world="office")
    try:
        answers = check(robot, rosmaster)
    finally:
        running.stop()
    assert {name: answer["text"] for name, answer in answers.items() if answer["level"] != "ok"} == {}
    assert running.node in answers["drive"]["text"]


def test_a_robot_that_is_off_gives_one_answer_with_advice(robot: Robot, rosmaster: Master) -> None:
    uri = f"http://127.0.0.1:{free_port()}"
    answers = check(robot, rosmaster, master_uri=uri)
    assert list(answers) == ["master"]
    assert uri in answers["master"]["text"]
    assert "Is the robot on" in answers["master"]["advice"]


def test_a_master_whose_name_is_unknown_asks_for_an_alias(robot: Robot, rosmaster: Master) -> None:
    answers = check(robot, rosmaster, master_uri="http://tiago-42c.invalid:11311")
    assert "cannot be resolved" in answers["master"]["text"]


def test_nodes_with_unknown_names_are_found_and_aliases_help(robot: Robot, fresh_master: Master) -> None:
    environment = {key: value for key, value in fresh_master.environment().items() if key != "ROS_IP"}
    with subprocess.Popen(
        [sys.executable, "-c", NAMED_ROBOT, ODOMETRY],
        env={**environment, "ROS_HOSTNAME": "tiago-42c.invalid"},
        stdout=subprocess.PIPE,
        cwd=REPOSITORY,
    ) as base:
        assert base.stdout is not None
        assert base.stdout.readline() == b"ready\n"
        try:
            without = check(robot, fresh_master)
            cured = check(robot, fresh_master, host_aliases={"tiago-42c.invalid": "127.0.0.1"})
        finally:
            base.kill()
    assert "tiago-42c.invalid, which cannot be resolved here" in without["names, robot to console"]["text"]
    assert without["odometry"]["level"] == "fail"
    assert cured["names, robot to console"]["level"] == "ok"
    assert cured["odometry"]["level"] == "ok"


def test_an_address_at_which_the_robot_cannot_call_back_is_found(robot: Robot, fresh_master: Master) -> None:
    answers = check(robot, fresh_master, advertised_address="console.invalid")
    assert answers["names, console to robot"]["level"] == "fail"
    assert answers["names, console to robot"]["advice"] == "Set the robot’s advertised address to 127.0.0.1."


def test_the_check_leaves_nothing_at_the_master(robot: Robot, fresh_master: Master) -> None:
    check(robot, fresh_master)
    published, subscribed, _ = ServerProxy(fresh_master.uri).getSystemState("/test")[2]
    assert published == subscribed == []


def test_a_clock_an_hour_ahead_is_reported(robot: Robot, ros: RosClient) -> None:
    with odometry_from(ros, ahead_s=3600.0):
        answers = check(robot, ros.master)
    assert answers["odometry"]["level"] == "ok"
    assert answers["clock"]["level"] == "warn"
    assert "s ahead of the console’s clock" in answers["clock"]["text"]


def test_a_part_of_the_description_that_is_left_out_is_named(robot: Robot, ros: RosClient) -> None:
    joints = "".join(
        f"<joint name='{name}' type='{kind}'><parent link='base'/><child link='{name}'/><axis xyz='0 0 0'/></joint>"
        for name, kind in (("lid", "revolute"), ("plate", "fixed"))
    )
    rospy.set_param("/robot_description", f"<robot name='r'><link name='base'/>{joints}</robot>")
    try:
        answers = check(robot, ros.master)
    finally:
        rospy.delete_param("/robot_description")
    assert answers["description"]["text"] == (
        "/robot_description is used, but: joint 'lid': its axis has no length: lid is left out."
    )


def test_a_wrong_topic_type_is_reported_with_both_types(robot: Robot, ros: RosClient) -> None:
    with ros.speak("/scan_raw", String, listeners=0):
        answers = check(robot, ros.master)
    assert answers["scan /scan_raw"]["text"] == "/scan_raw is a std_msgs/String, not a sensor_msgs/LaserScan."


def test_a_short_message_of_another_type_spoils_no_other_answer(robot: Robot, ros: RosClient) -> None:
    # two bytes where a stamp is expected
    publisher = rospy.Publisher(ODOMETRY, Bool, queue_size=1, latch=True)
    publisher.publish(Bool(True))
    try:
        answers = check(robot, ros.master)
    finally:
        publisher.unregister()
    assert answers["odometry"]["text"] == f"{ODOMETRY} is a std_msgs/Bool, not a nav_msgs/Odometry."
    assert answers["master"]["level"] == "ok"


def test_a_silent_topic_differs_from_a_missing_one(robot: Robot, ros: RosClient) -> None:
    with ros.speak(ODOMETRY, Odometry, listeners=0):
        answers = check(robot, ros.master)
    assert "exists, but no message came" in answers["odometry"]["text"]
    assert "No node publishes" in answers["scan /scan_raw"]["text"]


def test_a_sonar_that_reports_something_close_is_named(robot: Robot, ros: RosClient) -> None:
    ranges = {"base_sonar_01_link": 0.5, "base_sonar_02_link": 0.05, "base_sonar_03_link": math.inf}
    publisher = rospy.Publisher("/sonar_base", Range, queue_size=3)
    ending = threading.Event()

    def publish() -> None:
        while not ending.wait(0.05):
            for frame, range_m in ranges.items():
                publisher.publish(Range(header=Header(frame_id=frame), range=range_m))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        answers = check(robot, ros.master)
    finally:
        ending.set()
        thread.join()
        publisher.unregister()
    assert answers["sonars /sonar_base"]["level"] == "warn"
    assert answers["sonars /sonar_base"]["text"] == "/sonar_base: base_sonar_02_link reports 0.05 m."
    assert "clean the sensor" in answers["sonars /sonar_base"]["advice"]


def test_another_publisher_on_the_drive_topic_is_named(robot: Robot, ros: RosClient) -> None:
    from geometry_msgs.msg import Twist

    with ros.speak("/key_vel", Twist, listeners=0):
        answers = check(robot, ros.master)
    assert answers["other drivers"]["level"] == "warn"
    assert rospy.get_name() in answers["other drivers"]["text"]
    assert "No node listens to /key_vel" in answers["drive"]["text"]
