"""Messages that are read briefly hold what their generated classes hold."""

from __future__ import annotations

import io
import math
import struct

import nav_msgs.msg
import numpy as np
import pytest
import rospy
import sensor_msgs.msg

from robots.bridge.ros.sensors.brief import JointStates, Odometry, Scan
from robots.bridge.ros.sensors.convert import laser_scan, planar


def raw(message):
    message.header.stamp, message.header.frame_id = rospy.Time(1_790_000_000, 123_456_789), "a_frame"
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def odometry():
    message = nav_msgs.msg.Odometry(child_frame_id="base_footprint")
    pose, twist = message.pose.pose, message.twist.twist
    pose.position.x, pose.position.y, pose.position.z = 1.5, -2.25, 9.0
    pose.orientation.z, pose.orientation.w = math.sin(0.4), math.cos(0.4)
    twist.linear.x, twist.linear.y, twist.angular.z = 0.3, -0.1, 0.7
    return message


def scan():
    ranges = [0.5, 1.25, math.inf, -math.inf, math.nan]
    return sensor_msgs.msg.LaserScan(
        angle_min=-1.1, angle_increment=0.01, range_min=0.05, range_max=25.0, ranges=ranges, intensities=[1.0]
    )


def test_odometry_is_that_of_the_generated_class():
    whole, found = odometry(), Odometry().deserialize(raw(message := odometry()))
    assert (found.planar_pose, found.velocity) == planar(whole)
    assert found.stamp_s == message.header.stamp.to_sec()


def test_a_scan_is_that_of_the_generated_class():
    bytes_ = raw(scan())
    whole = laser_scan(sensor_msgs.msg.LaserScan().deserialize(bytes_), "/scan", 5.0)
    found = Scan().deserialize(bytes_).scan._replace(source="/scan", arrival_s=5.0)
    assert np.array_equal(found.ranges, whole.ranges, equal_nan=True)
    assert found.ranges.dtype == whole.ranges.dtype
    assert found._replace(ranges=()) == whole._replace(ranges=())


@pytest.mark.parametrize(("kind", "message"), [(Odometry, odometry()), (Scan, scan())])
def test_publishers_of_the_generated_class_connect(kind, message):
    assert (kind._type, kind._md5sum) == (message._type, message._md5sum)


@pytest.mark.parametrize(
    ("kind", "raw_", "least"),
    [(Odometry, raw(odometry()), 0), (Scan, raw(scan()), 8)],
    ids=["odometry", "scan"],
)
def test_a_message_that_is_too_short_is_refused(kind, raw_, least):
    for size in range(0, len(raw_) - least, 7):
        with pytest.raises((struct.error, ValueError)):
            kind().deserialize(raw_[:size])


def joints(names, positions):
    return raw(sensor_msgs.msg.JointState(name=names, position=positions, velocity=positions))


def test_joints_of_two_publishers_are_told_apart():
    reader = JointStates()
    arm, head = ["arm_1", "arm_2"], ["head_1"]
    for step in range(3):
        assert dict(reader.positions(joints(arm, [step, 2.0]))) == {"arm_1": step, "arm_2": 2.0}
        assert dict(reader.positions(joints(arm, [step, 3.0]))) == {"arm_1": step, "arm_2": 3.0}
        assert dict(reader.positions(joints(head, [4.0]))) == {"head_1": 4.0}
    assert dict(reader.positions(joints([], []))) == {}


def test_more_names_after_the_same_first_ones_are_read():
    reader = JointStates()
    assert dict(reader.positions(joints(["arm_1"], [1.0]))) == {"arm_1": 1.0}
    assert dict(reader.positions(joints(["arm_1", "arm_2"], [1.0, 2.0]))) == {"arm_1": 1.0, "arm_2": 2.0}


def test_joint_states_that_are_too_short_are_refused():
    whole = joints(["arm_1", "arm_2"], [1.0, 2.0])
    for size in range(0, len(whole) - 45, 3):
        with pytest.raises(struct.error):
            JointStates().positions(whole[:size])
