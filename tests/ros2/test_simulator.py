"""The simulated robot in ROS 2, as a plain rclpy client finds it."""

import pytest

from tests.ros2.side import needs_rclpy
from tests.sides.visitor import Visitor

ODOMETRY, TWIST = "nav_msgs/Odometry", "geometry_msgs/Twist"
MOTIONS = "/play_motion2", "play_motion2_msgs/PlayMotion2"
SPEECH = "/tts_engine/tts", "tts_msgs/TTS"
NAVIGATION = "/navigate_to_pose", "nav2_msgs/NavigateToPose"

pytestmark = [needs_rclpy, pytest.mark.usefixtures("robot")]


def test_it_drives_through_the_mux_and_stops_without_commands(visitor: Visitor) -> None:
    with (
        visitor.listen("/mobile_base_controller/odom", ODOMETRY) as odometry,
        visitor.speak("/key_vel", TWIST) as twists,
    ):
        begin = odometry.next()
        assert (begin.header.frame_id, begin.child_frame_id) == ("odom", "base_footprint")
        for _ in range(10):  # its velocity is limited by its acceleration
            twists.publish(linear={"x": 0.5})
            moving = odometry.next()
        odometry.until(lambda message: message.twist.twist.linear.x > 0.05)
        assert moving.header.stamp != begin.header.stamp
        odometry.until(lambda message: message.twist.twist.linear.x == 0.0)


def test_its_sensors_are_best_effort_and_its_description_stays(visitor: Visitor) -> None:
    with visitor.listen("/scan_raw", "sensor_msgs/LaserScan", sensor=True) as scans:
        assert len(scans.next().ranges) == 666
    for topic, kind, field in (
        ("/robot_description", "std_msgs/String", "data"),
        ("/map", "nav_msgs/OccupancyGrid", "data"),
        ("/tf_static", "tf2_msgs/TFMessage", "transforms"),
    ):
        with visitor.listen(topic, kind, kept=True) as messages:
            assert getattr(messages.next(), field)
    with (
        visitor.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray") as diagnostics,
        visitor.listen("/power/battery_level", "std_msgs/Float32") as battery,
    ):
        assert battery.next().data > 50.0
        assert diagnostics.next().status


def test_a_motion_plays_once_at_a_time_and_is_cancelled(visitor: Visitor) -> None:
    listed = visitor.call("/play_motion2/list_motions", "play_motion2_msgs/ListMotions")
    assert "wave" in listed.motion_keys
    assert visitor.parameter("/play_motion2", "motions.wave.joints")[0] == "arm_1_joint"
    assert visitor.parameter("/play_motion2", "motions.wave.meta.name") == "Wave"
    wave = visitor.goal(*MOTIONS, motion_name="wave")
    assert wave.accepted()
    assert not visitor.goal(*MOTIONS, motion_name="wave").accepted()
    visitor.cancel(MOTIONS[0])
    end, result = wave.ended()
    assert (end, result.success, result.error) == ("canceled", False, "")
    assert not visitor.goal(*MOTIONS, motion_name="no such motion").accepted()


def test_it_says_each_word(visitor: Visitor) -> None:
    said = visitor.goal(*SPEECH, input="Hello there", locale="en_GB")
    assert [said.feedback.next().word for _ in range(2)] == ["Hello", "there"]
    end, result = said.ended()
    assert (end, result.error_msg, result.text) == ("succeeded", "", "Hello there")
    end, result = visitor.goal(*SPEECH, input="Hello", locale="English").ended()
    assert (end, bool(result.error_msg)) == ("aborted", True)


def test_head_torso_and_gripper_follow_trajectories(visitor: Visitor) -> None:
    def at(*names: str) -> list[float]:
        state = joints.next()
        return [state.position[state.name.index(name)] for name in names]

    with (
        visitor.listen("/joint_states", "sensor_msgs/JointState") as joints,
        visitor.speak("/head_controller/joint_trajectory", "trajectory_msgs/JointTrajectory") as head,
    ):
        names = ["head_1_joint", "head_2_joint"]
        head.publish(joint_names=names, points=[{"positions": [0.3, -0.1], "time_from_start": 0.5}])
        while at(*names) != [0.3, -0.1]:
            pass
        for controller, names, positions in (
            ("torso", ["torso_lift_joint"], [0.17]),
            ("gripper", ["gripper_left_finger_joint", "gripper_right_finger_joint"], [0.03, 0.03]),
        ):
            points = [{"positions": positions, "time_from_start": 1.0}]
            moved = visitor.goal(
                f"/{controller}_controller/follow_joint_trajectory",
                "control_msgs/FollowJointTrajectory",
                trajectory={"joint_names": names, "points": points},
            )
            end, result = moved.ended()
            assert (end, result.error_code, result.error_string) == ("succeeded", 0, "")
            joints.drain()
            assert at(*names) == pytest.approx(positions)


def test_it_goes_to_a_pose_and_stops_when_all_goals_are_cancelled(visitor: Visitor) -> None:
    with (
        visitor.listen("/ground_truth/pose", ODOMETRY) as truth,
        visitor.listen("/cmd_vel", TWIST) as twists,
        visitor.speak("/goal_pose", "geometry_msgs/PoseStamped") as goals,
    ):
        x = truth.next().pose.pose.position.x
        target = {"position": {"x": x + 1.0, "y": 1.8}, "orientation": {"w": 1.0}}
        pose = {"header": {"frame_id": "map"}, "pose": target}
        goes = visitor.goal(*NAVIGATION, pose=pose)
        assert 0.5 < goes.feedback.next().distance_remaining < 1.5
        twists.until(lambda twist: twist.linear.x > 0.1)
        visitor.cancel(NAVIGATION[0])
        assert goes.ended()[0] == "canceled"
        truth.until(lambda message: message.twist.twist.linear.x < 0.001)
        elsewhere = visitor.goal(*NAVIGATION, pose={**pose, "header": {"frame_id": "base_link"}})
        assert elsewhere.ended()[0] == "aborted"
        twists.drain()
        goals.publish(**pose)
        twists.until(lambda twist: twist.linear.x > 0.1)
        visitor.cancel(NAVIGATION[0])
        twists.until(lambda twist: twist.linear.x == 0.0)


def test_its_cameras_publish(visitor: Visitor) -> None:
    for topic, kind in (
        ("/xtion/rgb/image_raw/compressed", "sensor_msgs/CompressedImage"),
        ("/xtion/depth_registered/image_raw", "sensor_msgs/Image"),
    ):
        with visitor.listen(topic, kind) as pictures:
            message = pictures.next()
        assert message.data > 1000  # its length
        assert message.header.frame_id == "xtion_rgb_optical_frame"
