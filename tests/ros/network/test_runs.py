"""A new publisher of odometry or a restarted master counts as a restarted robot."""

from __future__ import annotations

import rospy
from nav_msgs.msg import Odometry

from robots.bridge.ros.robot_runs import RunMonitor
from tests.ros.bridge_support import drivable, running_bridge, tiago_config

ODOMETRY = "/mobile_base_controller/odom"


def test_each_connection_and_master_run_counts_separately():
    runs, first, second = RunMonitor(), {"callerid": "/base"}, {"callerid": "/base"}
    numbers = [runs.of(first), runs.of(first), runs.of(second)]
    runs.start_run()
    numbers += [runs.of(second), runs.of(first), runs.of(second)]
    assert numbers == [1, 1, 2, 3, 3, 3], "two that publish in turn are no new ones each time"


def test_a_rival_publisher_stops_the_robot_until_neutral(ros, rosmaster, simulator, tmp_path):
    simulator(pose="2,1.8,0", seed=1, drift=0)
    with running_bridge(tiago_config(rosmaster, tmp_path), rosmaster, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.drive_until(0.2, lambda state: state.odometry.vx > 0.05, "motion")
        with ros.listen(ODOMETRY, Odometry) as listener, ros.speak(ODOMETRY, Odometry, listeners=2) as base:
            message = listener.next()
            message.header.stamp += rospy.Duration.from_sec(0.001)
            base.publish(message)
            state = hand.drive_until(0.2, lambda state: state.neutral_needed, "a stop")
            assert state.neutral_needed.code == "odometry_anew"
            state = hand.state_until(lambda state: state.forgotten.number, "pages to be told")
            assert state.forgotten.code == "odometry_restarted"
            hand.let_go()
            hand.state_until(lambda state: state.neutral_needed is None, "a stick in the middle")
            hand.drive_until(0.2, lambda state: state.odometry.vx > 0.05, "motion again")
