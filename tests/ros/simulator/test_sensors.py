"""The simulated robot's sensors on ROS: types, frames, rates, and faults."""

from __future__ import annotations

import math
from contextlib import contextmanager

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Pose2D, WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu, JointState, LaserScan, PointCloud2, Range
from std_msgs.msg import Bool, Float32, String
from tf2_msgs.msg import TFMessage

from tests.processes import until


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@contextmanager
def fault(ros, names: str):
    """Switch a fault on for the length of a `with` block."""
    with (
        ros.listen("/ground_truth/faults", String) as faults,
        ros.speak("/ground_truth/fault", String) as ask,
    ):
        ask.publish(names)
        faults.until(lambda message: message.data == names)
        try:
            yield
        finally:
            ask.publish("none")
            faults.until(lambda message: message.data == "none")


def test_the_raw_scan_is_tiagos(ros):
    with ros.listen("/scan_raw", LaserScan) as scans:
        scan = scans.next()
        later = scans.next()
    assert scan.header.frame_id == "base_laser_link"
    assert len(scan.ranges) == 666
    assert (scan.angle_min, scan.angle_max) == pytest.approx((-math.radians(110), math.radians(110)))
    assert scan.angle_min + 665 * scan.angle_increment == pytest.approx(scan.angle_max)
    assert (scan.range_min, scan.range_max) == pytest.approx((0.05, 25.0))
    assert (later.header.stamp - scan.header.stamp).to_sec() == pytest.approx(0.1, abs=0.06)


def test_a_scan_shows_the_wall_where_it_is(ros):
    with (
        ros.listen("/ground_truth/pose", Odometry) as truth,
        ros.listen("/scan_raw", LaserScan) as scans,
        ros.speak("/ground_truth/teleport", Pose2D) as teleport,
    ):
        teleport.publish(Pose2D(8.5, 2.5, 0.0))
        pose = truth.until(lambda message: abs(message.pose.pose.position.x - 8.5) < 0.01)
        scans.settle()
        ahead = [scans.next().ranges[333] for _ in range(5)]
    wall = 9.95 - pose.pose.pose.position.x - 0.202
    assert np.nanmean(ahead) == pytest.approx(wall, abs=0.03)


def test_the_filtered_scan_has_the_same_shape(ros):
    with ros.listen("/scan", LaserScan) as scans:
        assert len(scans.next().ranges) == 666


def test_three_sonars_share_a_topic(ros):
    with ros.listen("/sonar_base", Range) as sonars:
        messages = [sonars.next() for _ in range(6)]
    frames = [message.header.frame_id for message in messages]
    assert set(frames) == {f"base_sonar_0{number}_link" for number in (1, 2, 3)}
    assert messages[0].field_of_view == pytest.approx(0.5)
    assert (messages[0].min_range, messages[0].max_range) == pytest.approx((0.02, 1.0))


def test_joints_stand_at_home(ros):
    with ros.listen("/joint_states", JointState) as joints:
        message = joints.next()
    positions = dict(zip(message.name, message.position, strict=True))
    assert positions["torso_lift_joint"] == pytest.approx(0.15)
    assert {"arm_1_joint", "arm_7_joint", "head_1_joint", "head_2_joint"} <= set(positions)


def test_frames_reach_from_odom_to_the_sensors(ros):
    with ros.listen("/tf", TFMessage) as moving, ros.listen("/tf_static", TFMessage) as fixed:
        static = {frame.child_frame_id: frame for frame in fixed.next().transforms}
        dynamic = {}
        while "head_2_link" not in dynamic or "base_footprint" not in dynamic:
            dynamic |= {frame.child_frame_id: frame for frame in moving.next().transforms}
    laser = static["base_laser_link"]
    assert laser.header.frame_id == "base_link"
    assert laser.transform.translation.x == pytest.approx(0.202)
    assert laser.transform.translation.z == pytest.approx(0.0945)
    assert dynamic["base_footprint"].header.frame_id == "odom"
    parents = {child: frame.header.frame_id for child, frame in (static | dynamic).items()}
    frame = "xtion_rgb_optical_frame"
    while frame in parents and frame != "odom":  # odom's parent may be the map, if already published
        frame = parents[frame]
    assert frame == "odom"


def test_the_robot_describes_itself(ros):
    assert "<robot" in rospy.get_param("/robot_description")


def test_the_base_feels_gravity_and_the_wrist_its_hand(ros):
    with ros.listen("/base_imu", Imu) as imu, ros.listen("/wrist_ft", WrenchStamped) as wrist:
        assert imu.next().linear_acceleration.z == pytest.approx(9.81, abs=0.5)
        assert wrist.next().wrench.force.z < 0.0


def test_the_battery_is_published(ros):
    with (
        ros.listen("/power/battery_level", Float32) as level,
        ros.listen("/power/is_charging", Bool) as charging,
    ):
        assert 0.0 < level.next().data <= 100.0
        assert charging.next().data is False


def test_depth_is_sent_while_a_node_subscribes(ros):
    with (
        ros.listen("/xtion/depth_registered/image_raw", Image) as images,
        ros.listen("/xtion/depth_registered/camera_info", CameraInfo) as infos,
    ):
        image, info = images.next(), infos.next()
    assert (image.encoding, image.width, image.height) == ("32FC1", 640, 480)
    assert image.header.frame_id == "xtion_rgb_optical_frame"
    assert info.K[0] == pytest.approx(320 / math.tan(math.radians(31.5)))
    depth = np.frombuffer(image.data, dtype=np.float32)
    assert depth.size == 640 * 480
    assert 0.3 <= np.nanmin(depth) < np.nanmax(depth) <= 8.0


def test_colour_is_sent_to_readers_if_it_can_be_drawn(ros, robot):
    with ros.listen("/xtion/rgb/image_raw/compressed", CompressedImage) as images:
        blind = "no colour camera on this machine"
        arrived: list[CompressedImage] = []
        until(
            lambda: arrived.extend(images.drain()) or arrived or blind in robot.log.read_text(), "a picture"
        )
    if not arrived:
        pytest.skip(blind)
    assert arrived[0].data[:2] == b"\xff\xd8", "a JPEG"
    assert "jpeg" in arrived[0].format


def test_a_dead_laser_is_silent(ros):
    with ros.listen("/scan_raw", LaserScan) as scans, ros.listen("/sonar_base", Range) as sonars:
        scans.next()
        with fault(ros, "laser_dead"):
            scans.drain()
            for _ in range(8):
                sonars.next()
            assert len(scans.drain()) <= 1, "at most one was under way"
        scans.next()


def test_a_frozen_laser_repeats_itself(ros):
    with ros.listen("/scan_raw", LaserScan) as scans, fault(ros, "laser_frozen"):
        scans.settle()
        first, second = scans.next(), scans.next()
    assert first.header.stamp == second.header.stamp
    assert str(first.ranges) == str(second.ranges), "as text, in which nan equals nan"


def test_dead_odometry_is_silent(ros):
    with (
        ros.listen("/mobile_base_controller/odom", Odometry) as odometry,
        ros.listen("/scan_raw", LaserScan) as scans,
    ):
        odometry.next()
        with fault(ros, "odom_dead"):
            odometry.drain()
            scans.next()
            scans.next()
            assert len(odometry.drain()) <= 2, "no more than was under way"
        odometry.next()


def test_a_point_cloud_is_sent_only_on_request(ros):
    with ros.listen("/xtion/depth_registered/points", PointCloud2) as clouds:
        cloud = clouds.next()
    assert cloud.header.frame_id == "xtion_rgb_optical_frame"
    assert [field.name for field in cloud.fields] == ["x", "y", "z"]
    points = np.frombuffer(cloud.data, np.float32).reshape(cloud.height, cloud.width, 3)
    ahead = points[..., 2][np.isfinite(points[..., 2])]
    assert ahead.size > 0
    assert ahead.min() >= 0.3 and ahead.max() <= 8.0
