"""/play_motion behaves like PAL's, with real actionlib messages."""

from __future__ import annotations

import itertools
import queue
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import Mock
from xmlrpc.client import ServerProxy

import pytest
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from robots.bridge.ros.node import RosBase
from robots.bridge.ros.tasks.speech import SpeechTopics
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class, service_class
from tests.bridge.support import CONFIG
from tests.processes import PATIENCE_S
from tests.ros.motion_topics import motion_topics

_numbers = itertools.count()
RESULT = message_class("play_motion_msgs/PlayMotionResult")


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


class Player:
    """A client of the action's topics."""

    def __init__(self, goals, cancels, statuses, results) -> None:
        self.goals, self.cancels, self.statuses, self.results = goals, cancels, statuses, results

    def play(self, name: str) -> str:
        goal = message_class("play_motion_msgs/PlayMotionActionGoal")()
        goal.goal_id.id = f"test-{next(_numbers)}"
        goal.goal.motion_name = name
        self.goals.publish(goal)
        return goal.goal_id.id

    def result(self, goal_id: str):
        return self.results.until(lambda message: message.status.goal_id.id == goal_id)

    def begun(self, goal_id: str) -> None:
        self.statuses.until(
            lambda message: any(
                status.goal_id.id == goal_id and status.status == GoalStatus.ACTIVE
                for status in message.status_list
            )
        )


@pytest.fixture
def player(ros):
    with (
        ros.listen("/play_motion/status", message_class("actionlib_msgs/GoalStatusArray")) as statuses,
        ros.listen(
            "/play_motion/result", message_class("play_motion_msgs/PlayMotionActionResult")
        ) as results,
        ros.speak("/play_motion/goal", message_class("play_motion_msgs/PlayMotionActionGoal")) as goals,
        ros.speak("/play_motion/cancel", GoalID) as cancels,
    ):
        ros.connected(statuses, results)
        yield Player(goals, cancels, statuses, results)


def test_a_motion_moves_its_joints(ros, player):
    with ros.listen("/joint_states", JointState) as joints:
        result = player.result(player.play("open"))
        assert result.status.status == GoalStatus.SUCCEEDED
        assert result.result.error_code == RESULT.SUCCEEDED
        joints.settle()
        message = joints.next()
    positions = dict(zip(message.name, message.position, strict=True))
    assert positions["gripper_left_finger_joint"] == pytest.approx(0.044, abs=0.001)


def test_an_unknown_motion_is_rejected(player):
    result = player.result(player.play("dance"))
    assert result.status.status == GoalStatus.REJECTED
    assert result.result.error_code == RESULT.MOTION_NOT_FOUND
    assert "dance" in result.result.error_string


def test_a_busy_controller_rejects(player):
    first = player.play("wave")
    player.begun(first)
    result = player.result(player.play("home"))
    assert result.status.status == GoalStatus.REJECTED
    assert result.result.error_code == RESULT.CONTROLLER_BUSY
    player.cancels.publish(GoalID(id=first))
    player.result(first)


def test_a_cancelled_motion_is_preempted(player):
    goal_id = player.play("head_tour")
    player.begun(goal_id)
    player.cancels.publish(GoalID(id=goal_id))
    assert player.result(goal_id).status.status == GoalStatus.PREEMPTED


def test_a_goal_cancelled_before_it_arrived_is_recalled(player):
    goal_id = "cancelled-early"
    player.cancels.publish(GoalID(id=goal_id))
    player.statuses.until(lambda message: any(s.goal_id.id == goal_id for s in message.status_list))
    goal = message_class("play_motion_msgs/PlayMotionActionGoal")()
    goal.goal_id.id = goal_id
    goal.goal.motion_name = "wave"
    player.goals.publish(goal)
    assert player.result(goal_id).status.status == GoalStatus.RECALLED


def test_a_failure_is_aborted(ros, player):
    with (
        ros.listen("/ground_truth/faults", String) as faults,
        ros.speak("/ground_truth/fault", String) as ask,
    ):
        ask.publish("motion_fails")
        faults.until(lambda message: message.data == "motion_fails")
        result = player.result(player.play("close"))
        ask.publish("none")
        faults.until(lambda message: message.data == "none")
    assert result.status.status == GoalStatus.ABORTED
    assert result.result.error_code == RESULT.GOAL_NOT_REACHED


def test_motions_are_listed_without_durations():
    listed = rospy.ServiceProxy("/play_motion/list_motions", service_class("play_motion_msgs/ListMotions"))()
    assert {"home", "wave", "offer"} <= {motion.name for motion in listed.motions}
    assert {motion.duration.to_sec() for motion in listed.motions} == {0.0}


def test_the_action_says_if_the_arm_is_already_there():
    ask = rospy.ServiceProxy(
        "/play_motion/is_already_there", service_class("play_motion_msgs/IsAlreadyThere")
    )
    assert not ask("reach_max", 0.01).already_there
    with pytest.raises(rospy.ServiceException, match="no motion"):
        ask("dance", 0.01)


def test_motions_stand_on_the_parameter_server():
    motions = rospy.get_param("/play_motion/motions")
    assert len(motions) == 18
    wave = motions["wave"]
    assert set(wave["meta"]) == {"name", "usage", "description"}
    assert len(wave["points"][0]["positions"]) == len(wave["joints"])


@pytest.fixture
def reads(rosmaster):
    """Ask an action for its motions."""

    def read(action: str):
        received = []
        with motion_topics(
            {action}, rosmaster.uri, lambda _action, offers, _text: received.append(offers)
        ) as topics:
            topics.read()
        return received[0]

    return read


def test_a_long_list_of_motions_is_offered_with_durations(reads):
    kind = service_class("play_motion_msgs/ListMotions")
    info = message_class("play_motion_msgs/MotionInfo")
    motions = [info(f"m{number:03}", ["arm"], rospy.Duration(number, 500_000_000)) for number in range(200)]
    service = rospy.Service("/long_play/list_motions", kind, lambda _: kind._response_class(motions=motions))
    try:
        offers = reads("/long_play")
    finally:
        service.shutdown()
    assert [(offer.name, offer.duration_s) for offer in offers] == [
        (f"m{number:03}", number + 0.5) for number in range(200)
    ]


@contextmanager
def hung(service: str, master_uri: str) -> Iterator[queue.SimpleQueue]:
    """A service that reads every call and never answers. Yields its connections."""
    connections: queue.SimpleQueue = queue.SimpleQueue()

    def take() -> None:
        try:
            while True:
                connections.put(listener.accept()[0])
        except OSError:
            return

    master, node = ServerProxy(master_uri), "http://127.0.0.1:9/"
    with socket.create_server(("127.0.0.1", 0)) as listener:
        uri = f"rosrpc://127.0.0.1:{listener.getsockname()[1]}"
        master.registerService("/hung", service, uri, node)
        taking = threading.Thread(target=take)
        taking.start()
        try:
            yield connections
        finally:
            master.unregisterService("/hung", service, uri)
            listener.shutdown(socket.SHUT_RDWR)
            taking.join()


def test_an_action_that_hangs_is_let_go_of(reads, rosmaster):
    with hung("/hung_play/list_motions", rosmaster.uri) as connections:
        assert reads("/hung_play") == []
        connection = connections.get(timeout=PATIENCE_S)
        with connection:
            connection.settimeout(PATIENCE_S)
            while connection.recv(4096):  # until the client no longer waits and closes it
                pass
        assert connections.empty()


def test_leaving_a_topic_hides_no_cancel(ros, rosmaster):
    base = RosBase(CONFIG)
    tts = Topic("/left_tts", "pal_interaction_msgs/TtsAction")
    speech = SpeechTopics.of(Mock(config=Mock(topics=Mock(speech=tts))))
    speech.attend({"/left_tts", "/kept_tts"})
    try:
        with (
            motion_topics(["/left_play", "/kept_play"], rosmaster.uri, lambda *_: None) as motion_actions,
            ros.listen("/kept_play/cancel", GoalID) as motions,
            ros.listen("/kept_tts/cancel", GoalID) as texts,
        ):
            ros.connected(motions, texts)
            base.parts.connected = (motion_actions, speech)
            motion_actions._actions["/left_play"].close()
            speech._voices["/left_tts"].close()
            base.cancel_all()
            assert [inbox.next().id for inbox in (motions, texts)] == ["", ""]
    finally:
        speech.attend(())
