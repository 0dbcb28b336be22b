"""The denylist: every word and type that would bypass the chain of control or blind its sensors."""

import pytest

from robots.shared.configuration.bridge_config import DepthSource, HeadSource, ScanSource, Topic, Topics
from robots.shared.configuration.denylist import COUNTERFEITED, names_set, why_denied, why_fields_denied
from robots.shared.wire import Field

TEXT = "std_msgs/String"
TWIST = "geometry_msgs/Twist"
TTS = "pal_interaction_msgs/TtsAction"
PLAIN = Topics(drive=Topic("/drive", TWIST), odometry=Topic("/place", "nav_msgs/Odometry"))


def words(text):
    return text.split()


OVERRIDING = words("""
    /arm_controller/state /gripper/commands /arm/trajectory /mux/select /camera/reconfigure_server
    /camera/parameter_updates /lab/joy /joysticks /the_joypads /gamepads /teleoperation /tab_7 /base/lock /doorlocks
    /unlocked /unlock /interlocks /base_breaker /halt /enable_software_runstop /collision_monitor/enabled
    /joys /joyvel /tabs /rosapi/set_param /manager/load_nodelet /manager/bond /ur_driver/URScript /left/setpoint /pid
    /pause_all /brakes /base/stop /estops /is_emergency /closing_loop /safety_zone /deadman_switch
    /fleet_bridge/set_logger_level /fleet_inspector_lab_7_1/get_loggers /fleet_tap_lab_7_1/set_logger_level
    /fleet_recorder_lab_1/rate /fleet_camera_lab_1/rate /fleet_watchdog_lab/rate /script_command /run_script /scripts
""")
CHAIN = words("""
    /nav_vel /basevelocity /velocities /cmdvel /twisted /top_speed /planner/goal /planner/cancel_all /frontScan
    /allscans /laser_front /lidars /hokuyo /sick /sonars /ranges /ultrasound /bumpers /cliff_left /depthmap /points
    /cloud /disparity /xtion2 /realsense /odom_combined /visualodometry /joint_angles /tf2 /clock /sim_time
    /rawscan /baseScan /sCaN /SCAN /basecmd /goals /goalPose /odoms /drive_straight /steering /throttle /effort /torque
    /jog_frame /gazebo/set_model_state /imu/data /encoders /ekf/set_pose /reset /camera/set_camera_info /kinect2/sd
    /tfStatic /robot_state_publisher/rate /dock /undock /recharge /foo/cmd_vel
    /mobile_base_controller/cmd_vel_unstamped
    /robot_description /power_state /battery1 /batteries /charging /charges /docked
    /arm/cmd /leftwheel/amount /enable_motors /servos/1 /shutdown /reboots
""")
SENT = words("""
    geometry_msgs/Twist geometry_msgs/TwistWithCovarianceStamped geometry_msgs/AccelStamped geometry_msgs/Wrench
    ackermann_msgs/AckermannDrive lab_msgs/Twist2D lab_msgs/VelocityCommand lab_msgs/CmdVelStamped
    trajectory_msgs/JointTrajectoryPoint trajectory_msgs/Spline control_msgs/JointJog controller_manager_msgs/State
    lab_msgs/ArmJointTrajectoryPoint actionlib_msgs/GoalID lab_msgs/FetchAction lab_msgs/FetchActionGoal
    lab_msgs/FetchActionResult lab_msgs/FetchActionFeedback sensor_msgs/Joy lab_msgs/JoyFeedback sensor_msgs/LaserScan
    sensor_msgs/MultiEchoLaserScan sensor_msgs/LaserEcho sensor_msgs/Range lab_msgs/BumperEvent
    lab_msgs/BaseTwist lab_msgs/WheelVelocities lab_msgs/RawJoy lab_msgs/LaserScan lab_msgs/MyOdometry sensor_msgs/Imu
    gazebo_msgs/ModelState bond/Status power_msgs/BatteryState
    sensor_msgs/PointCloud sensor_msgs/PointCloud2 sensor_msgs/Image sensor_msgs/CompressedImage
    sensor_msgs/CameraInfo stereo_msgs/DisparityImage theora_image_transport/Packet nav_msgs/Odometry
    sensor_msgs/JointState sensor_msgs/MultiDOFJointState tf/tfMessage tf2_msgs/TFMessage
    geometry_msgs/TransformStamped rosgraph_msgs/Clock sensor_msgs/BatteryState sound_play/SoundRequest
""")
CALLED = words("""
    controller_manager_msgs/SwitchController dynamic_reconfigure/Reconfigure topic_tools/MuxSelect nodelet/NodeletUnload
    rosapi/SetParam gazebo_msgs/SetModelState power_msgs/BreakerCommand robot_localization/SetPose lab_srvs/SetVelocity
    sensor_msgs/SetCameraInfo lab_srvs/LoadController
""")
NO_FULL_NAMES = [
    *words(
        "notes ~notes /~notes //notes /demo//notes /notes/ / /1notes /demo/no-tes /nötes ./notes ../notes"
    ),
    *("", "/notes ", "/notes\n", "/notes\0", "/no tes", "/notes\u200b", "/n\u043etes"),
]


@pytest.mark.parametrize(("what", "type_name"), [("publish", TEXT), ("call", "std_srvs/Empty"), ("set", "")])
def test_names_of_the_safety_chain_are_denied(what, type_name):
    assert [name for name in OVERRIDING + CHAIN if not why_denied(what, name, type_name, PLAIN)] == []


def test_types_of_the_safety_chain_are_denied_on_any_topic():
    assert [name for name in SENT if not why_denied("publish", "/notes", name, PLAIN)] == []


def test_services_that_undo_the_chain_are_denied_by_type():
    assert [name for name in CALLED if not why_denied("call", "/notes", name, PLAIN)] == []


@pytest.mark.parametrize("what", ["publish", "call", "set"])
def test_names_that_ros_would_resolve_differently_are_denied(what):
    whys = {name: why_denied(what, name, TEXT, PLAIN) for name in NO_FULL_NAMES}
    assert whys == dict.fromkeys(NO_FULL_NAMES, "it is not a full ROS name")


def test_message_parts_are_denied_like_message_types():
    twist = Field("how", "geometry_msgs/Twist", -1)
    assert why_fields_denied("lab_msgs/Order", [Field("why", "string"), twist]) == why_fields_denied(
        TWIST, []
    )
    assert why_fields_denied("lab_msgs/Plan", [Field("steps", "lab_msgs/Order", fields=[twist])])
    assert (
        why_fields_denied("lab_msgs/Note", [Field("at", "std_msgs/Header", fields=[Field("seq", "uint32")])])
        is None
    )


def test_counterfeit_types_are_refused_under_their_own_name():
    assert [name for name in COUNTERFEITED if not why_fields_denied(name, [])] == []


def test_set_and_replaced_parameters_are_both_named():
    assert list(names_set("/a", {"b": {"c": 1}, "d": [1]}, 5)) == ["/a", "/a/b", "/a/b/c", "/a/d"]


def test_chosen_drive_topic_may_be_named_a_velocity():
    assert why_denied("choose", "/nav_vel", TWIST, PLAIN, "drive") is None


def test_choice_may_not_override_locks_or_joysticks():
    assert [name for name in OVERRIDING if not why_denied("choose", name, TWIST, PLAIN, "drive")] == []


def test_texts_are_said_where_nothing_else_listens():
    speaking = Topics(drive=PLAIN.drive, odometry=PLAIN.odometry, speech=Topic("/say", TEXT))
    names = OVERRIDING + CHAIN
    assert [name for name in names if not why_denied("choose", name, TEXT, speaking, "speech")] == []


def test_choice_needs_the_default_type_and_a_known_use():
    assert "TwistStamped" in why_denied("choose", "/nav_vel", f"{TWIST}Stamped", PLAIN, "drive")
    assert why_denied("choose", "/voice", TTS, PLAIN, "speech")
    assert why_denied("choose", "/voice", TTS, PLAIN, "")


def test_topics_of_the_profile_take_no_other_input():
    """This holds even if neither the topic's name nor its type shows its use."""
    topics = Topics(
        drive=Topic("/drive", TWIST),
        odometry=Topic("/place", "nav_msgs/Odometry"),
        scans=[ScanSource("/left_eye", (0.0, 0.0, 0.0)), ScanSource("/right_eye", (0.0, 0.0, 0.0))],
        depth=DepthSource("/brow", "sensor_msgs/Image", info="/brow_info"),
        speech=Topic("/say", TTS),
        cancel_on_stop=["/fetch"],
        head=HeadSource("/neck", "pan", "tilt", point_head="/gaze"),
    )
    for name in (
        "/drive",
        "/place",
        "/left_eye",
        "/right_eye",
        "/brow",
        "/brow_info",
        "/say",
        "/fetch",
        "/neck",
        "/gaze",
    ):
        assert why_denied("publish", name, TEXT, topics)
        assert (why_denied("choose", name, TWIST, topics, "drive") is None) == (name == "/drive")


@pytest.mark.parametrize(
    "name",
    [
        "/notes",
        "/visit_pose",
        "/stable",
        "/enjoy",
        "/level",
        "/travel/times",
        "/initialpose",
        "/lamp",
        "/physics",
        "/speech_description",
        "/speech/transcript",
    ],
)
def test_other_words_mean_nothing_of_the_kind(name):
    assert why_denied("publish", name, TEXT, PLAIN) is None


def test_parameters_of_motions_may_not_be_set():
    assert why_denied("set", "/play_motion/motions/wave/points", "", PLAIN)
    assert why_denied("set", "/play_motion_2", "", PLAIN)
    assert why_denied("call", "/play_motion/list_motions", "", PLAIN) is None
