"""A simulated robot needs little processor time, and runs on a machine without OpenGL."""

from __future__ import annotations

import psutil
import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, JointState, LaserScan, Range

from tests.processes import until


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(seed=1, environment={"PYOPENGL_PLATFORM": "no such platform"})


def test_without_a_viewer_it_takes_little_of_a_core(ros, robot):
    with (
        ros.listen("/mobile_base_controller/odom", Odometry) as odometry,
        ros.listen("/scan_raw", LaserScan),
        ros.listen("/sonar_base", Range),
        ros.listen("/joint_states", JointState),
    ):
        process = psutil.Process(robot.process.pid)
        begin = odometry.next().header.stamp.to_sec()
        used = sum(process.cpu_times()[:2])
        for _ in range(150):
            last = odometry.next()
        used = sum(process.cpu_times()[:2]) - used
    assert used / (last.header.stamp.to_sec() - begin) < 0.15


def test_a_machine_that_cannot_draw_loses_only_the_colour_camera(ros, robot):
    with (
        ros.listen("/xtion/rgb/image_raw", Image),
        ros.listen("/xtion/depth_registered/image_raw", Image) as depth,
        ros.listen("/mobile_base_controller/odom", Odometry) as odometry,
    ):
        until(lambda: "no colour camera on this machine" in robot.log.read_text(), "it says so")
        depth.settle()
        odometry.settle()
    assert robot.log.read_text().count("no colour camera") == 1
