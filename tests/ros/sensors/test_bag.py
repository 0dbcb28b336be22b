"""A rosbag of a drive, replayed to the gate."""

from __future__ import annotations

import pytest
import rosbag
from geometry_msgs.msg import Twist
from msgspec import structs
from nav_msgs.msg import Odometry
from rospy import Time
from sensor_msgs.msg import JointState, LaserScan

from robots.bridge.gate.gate import Gate
from robots.bridge.gate_trace import BadTrace
from robots.bridge.ros.sensors import bag
from robots.shared.configuration.bridge_config import ArmSource, ScanSource, Topic, Topics
from tests.gate.conftest import LASER, tiago_profile

TOPICS = Topics(
    drive=Topic("/key_vel", "geometry_msgs/Twist"),
    odometry=Topic("/odom", "nav_msgs/Odometry"),
    scans=[ScanSource(LASER, (0.202, 0.0, 0.0))],
)
PROFILE = tiago_profile(sonar_poses={}, sonar_fov={})


def filled(path, *, odometry=True):
    """A bag with 2 s of full stick towards a wall."""
    with rosbag.Bag(str(path), "w") as file:
        for tick in range(100):
            at = Time.from_sec(1000.0 + 0.02 * tick)
            pose = Odometry()
            pose.header.stamp = at
            pose.pose.pose.orientation.w = 1.0
            pose.pose.pose.position.x, pose.twist.twist.linear.x = 0.018 * tick, 0.9
            if odometry:
                file.write("/odom", pose, at)
            if tick % 5 == 0:
                scan = LaserScan(angle_min=-1.6, angle_increment=0.0056, range_min=0.05, range_max=25.0)
                scan.header.stamp = at
                scan.ranges = [float("inf")] * 261 + [2.0 - 0.018 * tick] * 50 + [float("inf")] * 260
                file.write(LASER, scan, at)
                twist = Twist()
                twist.linear.x = 1.0
                file.write("/key_vel", twist, at)
    return path


def test_commands_of_a_bag_are_judged_by_its_sensor_data(tmp_path):
    decisions = list(bag.drive(filled(tmp_path / "drive.bag"), Gate(PROFILE), TOPICS))
    assert len(decisions) == 20
    assert [decisions[0][0], decisions[-1][0]] == pytest.approx([1000.0, 1001.9])
    assert decisions[-1][1].code == "obstacle"
    assert decisions[-1][1].velocity.vx < 0.1 < decisions[5][1].velocity.vx


@pytest.mark.parametrize(("position", "held"), [(0.02, False), (0.5, True)])
def test_joint_states_of_a_bag_show_if_the_arm_is_at_home(tmp_path, position, held):
    topics = structs.replace(
        TOPICS, joint_states=Topic("/joint_states", "sensor_msgs/JointState"), arm=ArmSource({"arm": 0.0}, [])
    )
    path = filled(tmp_path / "drive.bag")
    with rosbag.Bag(str(path), "a") as file:
        for tick in range(100):
            at = Time.from_sec(1000.0 + 0.02 * tick)
            file.write("/joint_states", JointState(name=["arm"], position=[position]), at)
    gate = Gate(structs.replace(PROFILE, has_arm=True))
    *_, (_, verdict) = bag.drive(path, gate, topics)
    assert any(limit.code == "arm_away" for limit in verdict.limits) == held


def test_a_bag_without_odometry_or_a_missing_bag_is_refused(tmp_path):
    with pytest.raises(BadTrace, match="holds nothing on /odom"):
        list(bag.drive(filled(tmp_path / "blind.bag", odometry=False), Gate(PROFILE), TOPICS))
    rubbish = tmp_path / "rubbish.bag"
    rubbish.write_bytes(b"#ROSBAG V2.0\nrubbish")
    with pytest.raises(BadTrace, match=r"rubbish\.bag"):
        list(bag.drive(rubbish, Gate(PROFILE), TOPICS))
