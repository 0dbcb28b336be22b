"""``manage.py check_robot`` with a real rosmaster."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
import rospy
from sensor_msgs.msg import Range
from std_msgs.msg import Bool, Header

from robots.registry.models import Robot
from tests import check_robot
from tests.processes import REPOSITORY, free_port
from tests.ros.support import Master, RosClient

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
    address = {"master_uri": master.uri, "advertised_address": "127.0.0.1"}
    return check_robot.check(robot, **address | changes)


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
