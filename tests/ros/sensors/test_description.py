"""The robot's description and joints on their way from ROS to pages that draw the robot."""

from __future__ import annotations

import pytest
import rospy
from msgspec import structs
from sensor_msgs.msg import JointState

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.ros import node
from robots.bridge.ros.node import RosBase
from robots.shared import wire
from robots.shared.graph import SystemState
from robots.shared.ros.master import MasterError
from tests.bridge.support import CONFIG
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.support import Master
from tests.ros.tiago_arm import ARM, DESCRIPTION, HAND, JOINT_STATES, JOINTS, without_hand


@pytest.fixture(scope="module", autouse=True)
def simulated(ros, simulator):
    return simulator(world="office", pose="2.0,1.8,0", seed=3)


def test_a_bridge_hands_on_description_and_joints(rosmaster: Master, tmp_path):
    config = tiago_config(rosmaster, tmp_path, topics={"arm": ARM, "joint_states": JOINT_STATES})
    with running_bridge(config, rosmaster, tmp_path) as (bridge, hand):
        until(lambda: bridge.description() == "read", "the description")
        hand.send(wire.Viewers(["Ann"]))
        until(lambda: hand.view, "a view")
        assert hand.view.joints == {}
        hand.send(wire.Viewers(["Ann"], joints=True))
        until(lambda: hand.view.joints, "joints")
        joints = hand.view.joints
        assert {*JOINTS, "torso_lift_joint", "head_1_joint"} <= joints.keys()
        assert joints["arm_2_joint"] == pytest.approx(-1.34, abs=0.05)
        assert "wheel_left_joint" not in joints  # the description has no such joint
        hand.send(wire.Viewers(["Ann"]))
        until(lambda: not hand.view.joints, "no joints any more")


def test_a_huge_description_is_named_and_the_robot_drives(rosmaster: Master, tmp_path):
    before = rospy.get_param("/robot_description")
    rospy.set_param("/robot_description", f"<robot>{'x' * 20_000_000}</robot>")
    try:
        config = tiago_config(rosmaster, tmp_path)  # no arm: the description is read all the same
        with running_bridge(config, rosmaster, tmp_path) as (bridge, hand):
            until(lambda: "is too large" in bridge.description(), "the problem")
            hand.take_control(7)
            hand.drive_until(0.5, lambda state: state.odometry and state.odometry.vx > 0.1, "a drive")
    finally:
        rospy.set_param("/robot_description", before)


def test_a_description_that_changes_under_one_master_is_read_again(rosmaster: Master, ros, tmp_path):
    before = rospy.get_param("/robot_description")
    config = tiago_config(rosmaster, tmp_path, topics={"arm": ARM, "joint_states": JOINT_STATES})
    try:
        with running_bridge(config, rosmaster, tmp_path) as (bridge, hand):
            hand.send(wire.Viewers(["Ann"], joints=True))
            until(lambda: hand.view and "head_1_joint" in hand.view.joints, "joints")
            rospy.set_param("/robot_description", before.replace("head_1_joint", "neck_joint"))
            with ros.speak("/joint_states", JointState):  # a new node that publishes the robot's joints
                until(lambda: "head_1_joint" not in hand.view.joints, "the new description")
            assert "arm_1_joint" in hand.view.joints
            rospy.set_param("/robot_description", 7)  # the bridge reads this when the node has gone
            until(lambda: "is not a text" in bridge.description(), "the problem")
            until(lambda: not hand.view.joints, "no joints")
            hand.state_until(drivable, "a robot that can be driven as at its start without description")
    finally:
        rospy.set_param("/robot_description", before)


class Robot:
    """A bridge's ROS side with a master and a clock of its own."""

    def __init__(self, monkeypatch):
        config = structs.replace(
            CONFIG, topics=structs.replace(CONFIG.topics, arm=ARM, joint_states=JOINT_STATES)
        )
        self.base = RosBase(config)
        self.now_s = 1000.0
        self.description: object = DESCRIPTION
        self.publishers = {"/tf": ["/state_publisher"], "/joint_states": ["/controllers"], "/chat": ["/a"]}
        self.readings = 0
        self.taken: list[str] = []
        self.base._core = self
        self.needs_fresh_sensors = False
        self.base._loop = None  # type: ignore[assignment]
        monkeypatch.setattr(node.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(node, "Master", lambda *_: self)
        monkeypatch.setattr(self.base, "post", lambda call: call())
        self.base._describe()

    def parameter(self, _name):
        self.readings += 1
        if isinstance(self.description, Exception):
            raise self.description
        return self.description

    def described(self, taken, _failed):
        self.taken.append(taken.problem or taken.digest[:4])

    def surveys(self, seconds, **publishers):
        for _ in range(int(seconds / 2)):
            self.now_s += 2.0
            self.base._look_for_restart(SystemState({**self.publishers, **publishers}, {}, {}, {}))
            self.base._describe()


@pytest.fixture
def robot(monkeypatch):
    return Robot(monkeypatch)


def test_a_robot_that_stays_is_asked_seldom_and_handed_on_once(robot):
    robot.surveys(600)
    assert robot.readings <= 12 and len(robot.taken) == 1
    robot.needs_fresh_sensors = True
    before = robot.readings
    robot.surveys(600)
    assert robot.readings == before  # while the control loop runs, no description is parsed


def test_a_start_that_no_survey_saw_is_found_while_nobody_has_control(robot):
    robot.description = without_hand()
    robot.surveys(62)
    assert len(robot.taken) == 2 and robot.base.posture._model.lacking == [HAND]


@pytest.mark.parametrize("topic", ["/tf", "/joint_states", CONFIG.topics.odometry.name])
def test_nodes_that_come_and_go_lead_to_a_reading_also_in_control(robot, topic):
    robot.surveys(20)
    robot.needs_fresh_sensors = True
    robot.surveys(2, **{topic: []})
    robot.description = without_hand()
    robot.surveys(6, **{topic: ["/another"]})
    assert len(robot.taken) == 2 and robot.base.posture._model.lacking == [HAND]


def test_nodes_of_other_topics_lead_to_none_and_restless_ones_to_few(robot):
    robot.surveys(20)
    before = robot.readings
    robot.surveys(20, **{"/chat": ["/b"]})
    assert robot.readings == before
    for number in range(30):
        robot.surveys(2, **{"/tf": [f"/restless_{number}"]})
    assert robot.readings - before <= 60 / node.RESTARTED_S


@pytest.mark.parametrize("missing", [None, MasterError("no answer")])
def test_a_known_description_stays_while_none_can_be_read(robot, missing):
    known = robot.base.posture._model
    robot.description = missing
    robot.surveys(70)
    assert robot.base.posture._model is known and len(robot.taken) == 1
    robot.description = without_hand()
    robot.surveys(2)
    assert robot.base.posture._model.lacking == [HAND]


def test_a_reading_that_fails_in_control_waits_for_its_end(robot):
    robot.surveys(20)
    robot.needs_fresh_sensors, robot.description = True, MasterError("no answer")
    before = robot.readings
    robot.surveys(60, **{"/tf": ["/another"]})
    assert robot.readings == before + 1
    robot.needs_fresh_sensors, robot.description = False, without_hand()
    robot.surveys(62)
    assert robot.base.posture._model.lacking == [HAND]


def test_restless_nodes_lead_to_few_readings_in_control(robot):
    robot.surveys(20)
    robot.needs_fresh_sensors = True
    before = robot.readings
    for number in range(60):
        robot.surveys(2, **{"/tf": [f"/restless_{number}"]})
    assert robot.readings - before <= node.FRUITLESS + 120 / node.DESCRIBED_S


def test_a_large_new_description_waits_for_the_end_of_control(robot):
    robot.surveys(20)
    robot.needs_fresh_sensors, robot.description = True, without_hand() + " " * node.LARGE
    robot.surveys(60, **{"/tf": ["/another"]})
    assert len(robot.taken) == 1 and robot.base.posture._model.lacking == []
    robot.needs_fresh_sensors = False
    robot.surveys(62)
    assert robot.base.posture._model.lacking == [HAND]


def test_what_the_console_could_not_keep_is_handed_on_again(robot):
    robot.base._ask_again()
    robot.surveys(2)
    assert len(robot.taken) == 2


@pytest.mark.parametrize("arm", [ARM, None], ids=["with an arm", "without"])
def test_only_joints_of_the_description_are_shown(arm, caplog):
    posture = ArmPosture(arm)
    posture.describe(DESCRIPTION)
    posture.update([("arm_1_joint", 0.123456), ("arm_2_joint", float("nan")), ("stranger", 1.0)], 100.0)
    assert posture.shown(100.1) == {"arm_1_joint": 0.1235}
    assert posture.shown(200.0) == {}
    posture.describe(None)
    assert posture.shown(100.1) == {}
    assert not caplog.records
