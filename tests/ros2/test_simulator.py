"""The simulated robot in ROS 2, as a plain rclpy client finds it."""

import json
from typing import Any

import pytest

from tests.ros2.side import Side, needs_rclpy

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
ODOMETRY = "/mobile_base_controller/odom"
OPTIONS = ("--ros=2", "--name=tiago-9", "--pose=2,1.8,0", "--seed=1", "--drift=0", "--exit-with-parent")

pytestmark = needs_rclpy


class Visitor(Side):
    """`tests.ros2.visitor`."""

    def ask(self, **command: Any) -> None:
        self.say(json.dumps(command))

    def hear(self, word: str, which=lambda value: True) -> Any:
        """Return the next such answer; others are dropped."""

        def value(words: list[str]) -> Any:
            return json.loads(" ".join(words[1:]))

        return value(self.await_line(word, lambda words: which(value(words))))


@pytest.fixture(scope="module", autouse=True)
def robot(domain: int):
    side = Side("robots.simulator", domain, *OPTIONS)
    yield side
    side.close()


@pytest.fixture
def visitor(domain: int):
    side = Visitor("tests.ros2.visitor", domain)
    yield side
    side.close()


def test_it_drives_through_the_mux_and_stops_without_commands(visitor: Visitor) -> None:
    visitor.ask(listen=ODOMETRY, kind="nav_msgs/Odometry")
    begin = visitor.hear(ODOMETRY)
    assert (begin["header"]["frame_id"], begin["child_frame_id"]) == ("odom", "base_footprint")
    for _ in range(10):  # its velocity is limited by its acceleration
        visitor.ask(publish="/key_vel", kind="geometry_msgs/Twist", fields={"linear": {"x": 0.5}})
        moving = visitor.hear(ODOMETRY)
    assert visitor.hear(ODOMETRY, lambda message: message["twist"]["twist"]["linear"]["x"] > 0.05)
    assert moving["header"]["stamp"] != begin["header"]["stamp"]
    visitor.hear(ODOMETRY, lambda message: message["twist"]["twist"]["linear"]["x"] == 0.0)


def test_its_sensors_are_best_effort_and_its_description_stays(visitor: Visitor) -> None:
    visitor.ask(listen="/scan_raw", kind="sensor_msgs/LaserScan", sensor=True)
    assert visitor.hear("/scan_raw")["ranges"] == 666
    for topic, kind, field in (
        ("/robot_description", "std_msgs/String", "data"),
        ("/map", "nav_msgs/OccupancyGrid", "data"),
        ("/tf_static", "tf2_msgs/TFMessage", "transforms"),
    ):
        visitor.ask(listen=topic, kind=kind, kept=True)
        assert visitor.hear(topic)[field]
    visitor.ask(listen="/diagnostics", kind="diagnostic_msgs/DiagnosticArray")
    visitor.ask(listen="/power/battery_level", kind="std_msgs/Float32")
    assert visitor.hear("/power/battery_level")["data"] > 50.0
    assert visitor.hear("/diagnostics")["status"]


def test_a_motion_plays_once_at_a_time_and_is_cancelled(visitor: Visitor) -> None:
    visitor.ask(call="/play_motion2/list_motions", kind="play_motion2_msgs/ListMotions", fields={})
    assert "wave" in visitor.hear("answer")["motion_keys"]
    visitor.ask(parameters="/play_motion2", names=["motions.wave.joints", "motions.wave.meta.name"])
    joints, name = visitor.hear("parameters")
    assert (joints[0], name) == ("arm_1_joint", "Wave")
    wave = {"goal": "/play_motion2", "kind": "play_motion2_msgs/PlayMotion2"}
    visitor.ask(**wave, fields={"motion_name": "wave"})
    assert visitor.hear("accepted") is True
    visitor.ask(**wave, fields={"motion_name": "wave"})
    assert visitor.hear("accepted") is False
    visitor.ask(cancel="/play_motion2")
    assert visitor.hear("cancelled") == 1
    assert visitor.hear("ended") == [CANCELED, {"success": False, "error": ""}]
    visitor.ask(**wave, fields={"motion_name": "no such motion"})
    assert visitor.hear("accepted") is False


def test_it_says_each_word(visitor: Visitor) -> None:
    say = {"goal": "/tts_engine/tts", "kind": "tts_msgs/TTS"}
    visitor.ask(**say, fields={"input": "Hello there", "locale": "en_GB"})
    assert [visitor.hear("feedback")["word"] for _ in range(2)] == ["Hello", "there"]
    assert visitor.hear("ended") == [SUCCEEDED, {"error_msg": "", "text": "Hello there"}]
    visitor.ask(**say, fields={"input": "Hello", "locale": "English"})
    status, result = visitor.hear("ended")
    assert (status, bool(result["error_msg"])) == (ABORTED, True)


def test_head_torso_and_gripper_follow_trajectories(visitor: Visitor) -> None:
    def joints(*names: str) -> list[float]:
        state = visitor.hear("/joint_states")
        return [state["position"][state["name"].index(name)] for name in names]

    visitor.ask(listen="/joint_states", kind="sensor_msgs/JointState")
    points = [{"positions": [0.3, -0.1], "time_from_start": {"sec": 0, "nanosec": 500_000_000}}]
    head = {"joint_names": ["head_1_joint", "head_2_joint"], "points": points}
    visitor.ask(
        publish="/head_controller/joint_trajectory", kind="trajectory_msgs/JointTrajectory", fields=head
    )
    while joints("head_1_joint", "head_2_joint") != [0.3, -0.1]:
        pass
    for controller, names, positions in (
        ("torso", ["torso_lift_joint"], [0.17]),
        ("gripper", ["gripper_left_finger_joint", "gripper_right_finger_joint"], [0.03, 0.03]),
    ):
        trajectory = {
            "joint_names": names,
            "points": [{"positions": positions, "time_from_start": {"sec": 1}}],
        }
        visitor.ask(
            goal=f"/{controller}_controller/follow_joint_trajectory",
            kind="control_msgs/FollowJointTrajectory",
            fields={"trajectory": trajectory},
        )
        assert visitor.hear("ended") == [SUCCEEDED, {"error_code": 0, "error_string": ""}]
        assert joints(*names) == pytest.approx(positions)


def test_it_goes_to_a_pose_and_stops_when_all_goals_are_cancelled(visitor: Visitor) -> None:
    go = {"goal": "/navigate_to_pose", "kind": "nav2_msgs/NavigateToPose"}
    for topic, kind in (("/ground_truth/pose", "nav_msgs/Odometry"), ("/cmd_vel", "geometry_msgs/Twist")):
        visitor.ask(listen=topic, kind=kind)
    x = visitor.hear("/ground_truth/pose")["pose"]["pose"]["position"]["x"]
    target = {"position": {"x": x + 1.0, "y": 1.8}, "orientation": {"w": 1.0}}
    visitor.ask(**go, fields={"pose": {"header": {"frame_id": "map"}, "pose": target}})
    assert 0.5 < visitor.hear("feedback")["distance_remaining"] < 1.5
    visitor.hear("/cmd_vel", lambda twist: twist["linear"]["x"] > 0.1)
    visitor.ask(cancel="/navigate_to_pose")
    assert visitor.hear("ended")[0] == CANCELED
    visitor.hear("/ground_truth/pose", lambda message: message["twist"]["twist"]["linear"]["x"] < 0.001)
    visitor.ask(**go, fields={"pose": {"header": {"frame_id": "base_link"}, "pose": target}})
    assert visitor.hear("ended")[0] == ABORTED
    fields = {"header": {"frame_id": "map"}, "pose": target}
    visitor.ask(publish="/goal_pose", kind="geometry_msgs/PoseStamped", fields=fields)
    visitor.hear("/cmd_vel", lambda twist: twist["linear"]["x"] > 0.1)
    visitor.ask(cancel="/navigate_to_pose")
    assert visitor.hear("cancelled", lambda count: count == 1)


def test_its_cameras_publish(visitor: Visitor) -> None:
    for topic in ("/xtion/rgb/image_raw/compressed", "/xtion/depth_registered/image_raw"):
        kind = "sensor_msgs/CompressedImage" if topic.endswith("compressed") else "sensor_msgs/Image"
        visitor.ask(listen=topic, kind=kind)
        message = visitor.hear(topic)
        assert message["data"] > 1000
        assert message["header"]["frame_id"] == "xtion_rgb_optical_frame"
