"""The check of a robot with ROS 2: what it says of faults that only ROS 2 has."""

from functools import partial
from pathlib import Path

import pytest

from robots.bridge.ros2.network.interfaces import interfaces
from robots.registry.models import Robot, RobotProfile
from robots.shared.ros2.environment import WHEELS, ros_environment, site_packages
from tests import check_robot
from tests.processes import free_port
from tests.ros2.conftest import free_domain
from tests.ros2.side import Side, needs_rclpy

pytestmark = [needs_rclpy, pytest.mark.django_db]


@pytest.fixture
def check(db: None):
    """`check(**changes)`: run the command for a robot; return its answers by name."""
    profile = RobotProfile.objects.get(slug="tiago-ros2")
    robot = Robot.objects.create(slug="second", name="Second", profile=profile, discovery="localhost")
    return partial(check_robot.check, robot)


@pytest.fixture(scope="module")
def crooked():
    """The domain of a robot with many faults."""
    with free_domain() as found:
        side = Side("tests.ros2.crooked_robot", found)
        side.await_line("up")
        yield found
        side.close()


@pytest.fixture
def empty_domain():
    with free_domain() as found:
        yield found


def test_faults_that_dds_lets_live_are_named(check, crooked: int) -> None:
    answers = check(domain_id=crooked)
    found = {name: (answer["level"], answer["text"]) for name, answer in answers.items()}
    assert found["two robots"] == (
        "fail",
        "/base and /base publish odometry: two robots seem to be in this domain.",
    )
    assert found["scan /scan_raw"] == (
        "fail",
        "/scan_raw (sensor_msgs/msg/LaserScan) has other fields on the robot than in the package installed here.",
    )
    assert found["joint states"] == (
        "warn",
        "/joint_states is a sensor_msgs/msg/BatteryState, not a sensor_msgs/msg/JointState.",
    )
    later = "the console, which comes later, gets nothing."
    for name, topic in (("map", "/map"), ("fixed frames", "/tf_static")):
        assert found[name] == ("warn", f"/base publishes {topic} with durability volatile: {later}")
    assert found["drive"] == (
        "fail",
        "/base gets nothing on /key_vel: it asks for deadline 0.5 s, the console offers none.",
    )
    assert found["head"][1].endswith("asks for durability transient local, the console offers volatile.")
    assert found["pose"][1].endswith("asks for liveliness manual by topic, the console offers automatic.")
    assert found["other drivers"] == ("warn", "The bridges of two consoles publish to /key_vel.")
    assert found["motions"] == ("ok", "/play_motion2 (play_motion2_msgs/action/PlayMotion2): right type.")


def test_a_type_without_its_package_is_named(check, crooked: int, tmp_path: Path) -> None:
    """The set-up script is one of a distribution without PAL's packages."""
    environment = ros_environment([WHEELS], {}) | {"PYTHONPATH": str(site_packages(WHEELS))}
    script = tmp_path / "setup.bash"
    script.write_text("".join(f"export {name}={value}\n" for name, value in environment.items()))
    answers = check(domain_id=crooked, ros_setup=str(script))
    assert answers["motions"]["text"] == (
        "The console does not know the type play_motion2_msgs/action/PlayMotion2."
    )
    assert "joint states" in answers


def test_a_distribution_that_is_missing_or_another_s_is_named(check, tmp_path: Path) -> None:
    (missing,) = check(ros_setup="/opt/ros/none/setup.bash").values()
    assert (missing["name"], missing["level"]) == ("software", "fail")
    assert "/opt/ros/none/setup.bash of ROS cannot be read" in missing["text"]
    packages = tmp_path / "lib" / "python3.4" / "site-packages"
    (packages / "rclpy").mkdir(parents=True)
    script = tmp_path / "setup.bash"
    script.write_text(f"export PYTHONPATH={packages}\n")
    (other,) = check(ros_setup=str(script)).values()
    assert "is made for python3.4" in other["text"]


def test_a_robot_in_another_domain_is_named_there(check, crooked: int, empty_domain: int) -> None:
    answers = check(domain_id=empty_domain)
    assert list(answers) == ["domain"]
    text = answers["domain"]["text"]
    assert text.startswith(f"No node answers in domain {empty_domain}.")
    assert f"/base publishes /mobile_base_controller/odom in domain {crooked}: is that the robot?" in text
    assert text.endswith("The search stays on this computer.")
    assert f"ROS_DOMAIN_ID should be {empty_domain}" in answers["domain"]["advice"]


def test_a_robot_in_another_namespace_is_named_there(check, crooked: int) -> None:
    answers = check(domain_id=crooked, namespace="/tiago1")
    assert list(answers) == ["domain", "namespace"]
    assert answers["namespace"]["text"].endswith("but there is such a topic in the namespace /.")


def test_how_this_computer_searched_is_said(check, empty_domain: int) -> None:
    answers = check(domain_id=empty_domain, discovery="off", static_peers="127.0.0.1")
    assert (
        f"127.0.0.1 is on, but no node listens there in domain {empty_domain}." in answers["domain"]["text"]
    )
    answers = check(domain_id=empty_domain, static_peers="tiago-42c.invalid")
    assert answers["domain"]["text"] == "The address of tiago-42c.invalid is not known on this computer."
    server = f"127.0.0.1:{free_port()}"
    answers = check(domain_id=empty_domain, static_peers="", discovery_server=server)
    assert answers["domain"]["text"].endswith(
        f"Only the discovery server {server} was asked. Nothing listens at {server}."
    )


def test_where_multicast_leaves_this_computer_is_said(check, empty_domain: int) -> None:
    text = check(domain_id=empty_domain, discovery="subnet")["domain"]["text"]
    networks = [f"{one.address} ({one.name})" for one in sorted(interfaces()) if one.takes_multicast]
    way = f"Multicast can leave this computer from {', '.join(networks)}."
    assert text.endswith(way if networks else "No network of this computer takes multicast.")
