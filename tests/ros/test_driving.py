"""The simulated robot drives as TIAGo does."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import pytest
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1, drift=0)


def forward(mps: float) -> Twist:
    twist = Twist()
    twist.linear.x = mps
    return twist


def drive(publisher: rospy.Publisher, twist: Twist, odometry, ticks: int) -> Odometry:
    """Publish once per odometry message, so that the pace is the robot's own."""
    for _ in range(ticks):
        publisher.publish(twist)
        last = odometry.next()
    return last


def test_it_drives_on_key_vel_and_stops_by_itself(ros):
    with (
        ros.listen("/mobile_base_controller/odom", Odometry) as odometry,
        ros.speak("/key_vel", Twist) as keys,
    ):
        start = odometry.next().pose.pose.position.x
        moving = drive(keys, forward(0.3), odometry, 40)
        assert moving.twist.twist.linear.x == pytest.approx(0.3, abs=0.02)
        assert moving.pose.pose.position.x > start + 0.1
        odometry.until(lambda message: abs(message.twist.twist.linear.x) < 0.001, timeout_s=2.0)


def test_it_scans(ros):
    with ros.listen("/scan_raw", LaserScan) as scans:
        scan = scans.next()
    assert scan.header.frame_id == "base_laser_link"
    assert len(scan.ranges) == 666
