"""A robot whose nodes follow a simulated clock, slower than ours, is not late, and its messages have no ages."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack

import pytest
import rospy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan

from tests.ros.bridge_support import running_bridge, tiago_config

PACE = 0.7
SECONDS = 3.0


@pytest.fixture
def simulation(ros):
    """Publish /clock, odometry and scans by a clock that began at 100 s."""
    over = threading.Event()
    began_s = time.monotonic()
    with ExitStack() as stack:
        clock = stack.enter_context(ros.speak("/clock", Clock, listeners=0))
        odometry = stack.enter_context(ros.speak("/mobile_base_controller/odom", Odometry, listeners=0))
        scans = stack.enter_context(ros.speak("/scan_raw", LaserScan, listeners=0))

        def run():
            number = 0
            while not over.wait(0.02):
                now = rospy.Time.from_sec(100.0 + PACE * (time.monotonic() - began_s))
                clock.publish(Clock(now))
                moved = Odometry()
                moved.header.stamp, moved.pose.pose.orientation.w = now, 1.0
                odometry.publish(moved)
                if number % 5 == 0:
                    scan = LaserScan(
                        angle_min=-1.5, angle_max=1.5, angle_increment=0.05, range_min=0.1, range_max=25.0
                    )
                    scan.header.stamp, scan.header.frame_id, scan.ranges = now, "base_laser_link", [20.0] * 60
                    scans.publish(scan)
                number += 1

        rospy.set_param("/use_sim_time", True)
        thread = threading.Thread(target=run)
        thread.start()
        yield
        over.set()
        thread.join()
        rospy.delete_param("/use_sim_time")


def test_a_slow_simulated_clock_is_no_lateness(simulation, rosmaster, tmp_path):
    with running_bridge(tiago_config(rosmaster, tmp_path), rosmaster, tmp_path) as (_, hand):
        hand.state_until(lambda state: state.odometry and state.clock_skew_s is None, "the simulated clock")
        until_s = time.monotonic() + SECONDS
        seen = []
        hand.state_until(
            lambda state: seen.append(state.latency_s) or time.monotonic() > until_s, "states of some seconds"
        )
    assert max(seen) < 0.5
