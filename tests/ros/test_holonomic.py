"""A base that can move sideways: the stick to the left and right, and the gate at the sides of the base."""

from __future__ import annotations

import math

import pytest
from nav_msgs.msg import Odometry
from std_msgs.msg import String

from robots.shared.configuration.bridge_config import ScanSource, Topic, Topics
from robots.shared.configuration.gate_profile import GateProfile, Limits
from tests.ros.bridge_support import drivable, running_bridge, tiago_config

HALF_WIDTH_M = 0.28
TOPICS = Topics(
    drive=Topic("/cmd_vel", "geometry_msgs/Twist"),
    odometry=Topic("/odom", "nav_msgs/Odometry"),
    scans=[ScanSource("/scan", (0.0, 0.0, 0.0))],
)
GATE = GateProfile(
    limits=Limits(0.6, 0.3, 0.3, 1.2, 0.5, 1.2),
    radius_m=None,
    outline=((0.35, HALF_WIDTH_M), (-0.35, HALF_WIDTH_M), (-0.35, -HALF_WIDTH_M), (0.35, -HALF_WIDTH_M)),
    scan_poses={"/scan": (0.0, 0.0, 0.0)},
    sonar_poses={},
    sonar_fov={},
    has_depth=False,
    blind_mps=0.2,
)


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    """A robot with a wall on its right. The wall's face is at y = 0."""
    return simulator(pose="7.6,1.2,0", base="generic_omni", seed=1)


def test_a_lateral_stick_slides_up_to_the_wall(ros, rosmaster, tmp_path):
    config = tiago_config(rosmaster, tmp_path, topics=TOPICS, gate=GATE)
    with (
        running_bridge(config, rosmaster, tmp_path) as (_, hand),
        ros.listen("/ground_truth/pose", Odometry) as truth,
        ros.listen("/ground_truth/contacts", String) as contacts,
    ):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        contacts.drain()
        sliding = hand.drive_until(
            0.0, lambda state: state.odometry.vy < -0.2, "a slide to the right", y=-1.0
        )
        stopped = hand.drive_until(
            0.0,
            lambda state: state.verdict.code == "obstacle" and abs(state.odometry.vy) < 0.01,
            "a stop",
            y=-1.0,
        )
        [*_, last] = truth.drain()
        hand.drive_until(0.0, lambda state: state.odometry.vy > 0.1, "the way back", y=1.0)
    assert abs(sliding.odometry.vx) < 0.05
    assert "right" in stopped.verdict.side
    assert stopped.verdict.text.endswith("right")
    assert 0.0 < last.pose.pose.position.y - HALF_WIDTH_M < 0.2
    assert math.isclose(last.pose.pose.position.x, 7.6, abs_tol=0.1)
    assert '"contacts": [{' not in "".join(message.data for message in contacts.drain())
