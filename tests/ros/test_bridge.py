"""The bridge with a real master and a simulated TIAGo: it survives faults and refuses bad commands."""

from __future__ import annotations

import signal
import socket
import statistics
import struct
import time
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from unittest.mock import patch
from xmlrpc.client import ServerProxy

import msgspec
import pytest
import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rospy.msg import serialize_message
from sensor_msgs.msg import Range

from robots.bridge.core import Core
from robots.bridge.lease.state_store import StateStore
from robots.bridge.process import Bridge
from robots.bridge.ros.node import RosBase
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros1
from robots.shared.processes.shutdown import EXIT_NAME_LOST
from tests.bridge.support import MemorySink
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import BridgeProcess, drivable, tiago_config
from tests.ros.support import Master, SimulatorProcess

ODOMETRY = "/mobile_base_controller/odom"


@pytest.fixture(scope="module", autouse=True)
def robot(rosmaster, simulator) -> SimulatorProcess:
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@pytest.fixture
def bridges(tmp_path):
    started: list[BridgeProcess] = []

    def start(master: Master, config=None, **changes) -> BridgeProcess:
        bridge = BridgeProcess(config or tiago_config(master, tmp_path, **changes), master, tmp_path)
        started.append(bridge)
        return bridge

    yield start
    for bridge in started:
        bridge.stop()


@pytest.fixture
def bridge(bridges, rosmaster) -> BridgeProcess:
    return bridges(rosmaster)


@pytest.fixture
def hand(bridge):
    hand = bridge.link()
    hand.state_until(drivable, "the robot to be online")
    hand.take_control(1)
    yield hand
    hand.close()


def moving(message: Odometry) -> bool:
    return abs(message.twist.twist.angular.z) > 0.2


def still(message: Odometry) -> bool:
    return abs(message.twist.twist.linear.x) < 0.01 and abs(message.twist.twist.angular.z) < 0.02


def is_zero(twist: Twist) -> bool:
    return twist.linear.x == twist.linear.y == twist.angular.z == 0.0


def test_an_ending_bridge_sends_zero_whatever_else_fails(rosmaster, tmp_path):
    bridge = Bridge(tiago_config(rosmaster, tmp_path), MemorySink(), StateStore(tmp_path, "robot"))
    with (
        patch.object(Core, "close", side_effect=RuntimeError("broken")),
        patch.object(RosBase, "stop") as stop,
        pytest.raises(RuntimeError, match="broken"),
    ):
        bridge._leave_at_zero(time.monotonic())
    stop.assert_called_once_with()


def test_after_a_killed_bridge_the_robot_stops_and_keeps_a_stop(ros, hand, bridge, bridges, rosmaster):
    with ros.listen(ODOMETRY, Odometry) as odometry:
        hand.stick(0.0, 0.5)
        odometry.until(moving)
        hand.send(wire.LinkStop("Bob"))
        hand.until(lambda report: isinstance(report, wire.Stopped), "the stop's answer")
        until(lambda: b'"latched":true' in state_file(bridge).read_bytes(), "the latch on disk")
        bridge.kill()
        odometry.until(still)
    again = bridges(rosmaster, bridge.config).link()
    state = again.state_until(lambda state: True, "a hello")
    assert state.stop.state == "stopping"  # until odometry comes again
    assert state.stop.by == "Bob"
    again.state_until(lambda state: state.stop.state == "stopped", "standstill, seen")


def test_an_old_latched_stop_cancels_everybodys_goals(ros, hand, bridge, bridges, rosmaster):
    with ros.listen("/play_motion/cancel", GoalID) as cancels:
        hand.send(wire.LinkStop("Bob"))
        until(lambda: b'"latched":true' in state_file(bridge).read_bytes(), "the latch on disk")
        bridge.kill()
        until(lambda: not cancels.publishers, "the bridge's end")
        cancels.drain()
        bridges(rosmaster, bridge.config)
        assert cancels.next() == GoalID()


def state_file(bridge: BridgeProcess) -> Path:
    return Path(bridge.config.state_dir) / f"{bridge.config.robot_id}.json"


def send_grant(hand, fence: int, session: str):
    hand.send(wire.Grant(fence, 3.0, session, "Eve", "eve", 1.0))
    return hand.until(lambda report: isinstance(report, wire.Granted | wire.Refused), "an answer")


def test_an_old_number_is_refused_after_a_kill(hand, bridge, bridges, rosmaster):
    hand.take_control(8)
    bridge.kill()
    again = bridges(rosmaster, bridge.config).link()
    answer = send_grant(again, 7, "session-7")
    assert isinstance(answer, wire.Refused)
    assert answer.refusal.code == "old_fence"


def test_a_lost_state_file_counts_as_a_pressed_stop(hand, bridge, bridges, rosmaster):
    bridge.kill()
    state_file(bridge).unlink()
    again = bridges(rosmaster, msgspec.structs.replace(bridge.config, last_fence=1)).link()
    state = again.state_until(lambda state: True, "a hello")
    assert state.stop.state == "stopping"  # until odometry comes again
    assert "missing" in state.stop.reason


def test_a_wrong_type_in_the_registry_is_said_in_words(bridges, rosmaster, tmp_path):
    topics = {"odometry": Topic("/scan_raw", "nav_msgs/Odometry"), "scans": []}
    hand = bridges(rosmaster, topics=topics).link()
    state = hand.state_until(lambda state: "/scan_raw" in state.text, "the problem in words")
    assert state.phase == "connecting"
    assert state.text == "/scan_raw is sensor_msgs/LaserScan on the robot, nav_msgs/Odometry in the registry."


def test_a_bridge_that_lost_its_name_ends_for_a_new_one(bridge, bridges, hand, rosmaster):
    with ServerProxy(rosmaster.uri) as master:  # another node with this name, which has already ended
        gone = "http://127.0.0.1:9/"
        master.registerPublisher("/fleet_bridge", "/elsewhere", "std_msgs/Empty", gone)
        assert bridge.process.wait(PATIENCE_S) == EXIT_NAME_LOST  # although the bridge publishes continuously
        fresh = bridges(rosmaster, bridge.config).link()
        fresh.state_until(drivable, "the fresh bridge to be online")
        master.unregisterPublisher("/fleet_bridge", "/elsewhere", gone)
    fresh.close()


def test_sonars_sharing_a_topic_are_all_heard(ros, bridges, rosmaster, tmp_path):
    ordinary = tiago_config(rosmaster, tmp_path).topics.sonars
    sonars = [msgspec.structs.replace(sonar, topic="/sonars") for sonar in ordinary]
    hand = bridges(rosmaster, topics={"sonars": sonars}).link()

    def burst() -> None:
        packet = BytesIO()  # one packet: all messages arrive together
        for number, sonar in enumerate(sonars):
            reading = Range(range=0.5, min_range=0.1, max_range=1.0)
            reading.header.frame_id = sonar.frame_id
            reading.header.stamp = rospy.Time.from_sec(time.time())
            serialize_message(packet, number, reading)
        [connection] = publisher.impl.connections
        connection.write_data(packet.getvalue())

    def heard(state: wire.State) -> bool:
        return all(sensor.ok for sensor in state.sensors if sensor.kind == "sonar")

    with ros.speak("/sonars", Range) as publisher:
        burst()
        hand.state_until(heard, "every sonar of the first burst")
    hand.close()


def test_a_listener_that_does_not_read_is_cut_off(ros, hand):
    with ros.listen("/key_vel", Twist) as twists, ros.listen(ODOMETRY, Odometry) as odometry:
        longest_s = [longest_wait_with_a_deaf_one_s(ros, hand, twists, odometry) for _ in range(3)]
        twists.next()
    assert statistics.median(longest_s) < 0.4  # median: a busy computer may pause once


def longest_wait_with_a_deaf_one_s(ros, hand, twists, odometry):
    """Return the longest time (s) from a stick to its twist while the bridge serves a subscriber that never reads."""
    waits_s = []
    with deaf_subscriber("/key_vel", Twist, ros.master.uri) as bridge_node:
        hand.stick(0.0, 0.1)
        twists.until(lambda twist: twist.angular.z > 0.0)
        while serves_deaf(bridge_node):  # the test's time limit ends the loop at the latest
            odometry.next()
            twists.drain()
            for _ in range(10):
                began_s = time.monotonic()
                hand.stick(0.0, 0.1)
                twists.next()
                waits_s.append(time.monotonic() - began_s)
    return max(waits_s)


@contextmanager
def deaf_subscriber(topic: str, kind: type, master_uri: str):
    """A subscriber with the smallest buffer that never reads after the handshake."""
    master = ServerProxy(master_uri)
    _, _, publishers = master.registerSubscriber("/deaf", topic, kind._type, "http://127.0.0.1:9/")
    node = next(uri for uri in publishers if uri == master.lookupNode("/deaf", "/fleet_bridge")[2])
    _, _, (_, host, port) = ServerProxy(node).requestTopic("/deaf", topic, [["TCPROS"]])
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        connection.connect((host, port))
        fields = {"callerid": "/deaf", "topic": topic, "type": kind._type, "md5sum": kind._md5sum}
        lines = [f"{key}={value}".encode() for key, value in fields.items()]
        header = b"".join(struct.pack("<I", len(line)) + line for line in lines)
        connection.sendall(struct.pack("<I", len(header)) + header)
        try:
            until(lambda: serves_deaf(node), "the deaf listener among the bridge's connections")
            yield node
        finally:
            master.unregisterSubscriber("/deaf", topic, "http://127.0.0.1:9/")


def serves_deaf(node: str) -> bool:
    """True if the bridge's node lists a connection to the deaf subscriber."""
    _, _, connections = ServerProxy(node).getBusInfo("/test")
    return any("/deaf" in connection for connection in connections)


class TestMasterGone:
    """These tests break their master, so each starts a new one."""

    @pytest.fixture
    def master(self, tmp_path):
        master = Master(tmp_path / "master")
        yield master
        master.stop()

    def test_a_bridge_waits_for_its_master_and_finds_the_robot(self, master, bridges, tmp_path):
        hand = bridges(master).link()
        state = hand.state_until(lambda state: "No ROS master answers" in state.text, "waiting")
        assert state.phase == "waiting"
        master.start()
        robot = SimulatorProcess(master, tmp_path / "robot.log", "late", pose="2,1.8,0").wait_ready()
        hand.state_until(drivable, "the robot")
        robot.stop()

    def test_a_name_that_cannot_be_resolved_is_said_in_words(self, master, bridges):
        hand = bridges(master, ros=Ros1("http://tiago-nowhere.invalid:11311/")).link()
        state = hand.state_until(lambda state: "alias" in state.text, "the advice")
        assert "tiago-nowhere.invalid" in state.text

    def test_a_killed_master_stops_the_robot_until_it_is_back(self, master, bridges, tmp_path):
        master.start()
        robot = SimulatorProcess(master, tmp_path / "robot.log", "r", pose="2,1.8,0").wait_ready()
        hand = bridges(master).link()
        hand.state_until(drivable, "the robot")
        hand.take_control(1)
        hand.stick(0.0, 0.5)
        hand.state_until(lambda state: state.odometry and abs(state.odometry.w) > 0.2, "turning")
        master.kill()
        hand.state_until(
            lambda state: state.phase == "waiting" and state.neutral_needed, "the loss to be noticed"
        )
        master.start()
        back_s = time.monotonic()
        hand.state_until(drivable, "the robot again")
        assert time.monotonic() - back_s < 5.0
        hand.stick(0.0, 0.0)
        hand.state_until(lambda state: state.neutral_needed is None, "the middle to count")

        def turns():  # on a busy computer the laser may be late once more
            state = hand.state
            hand.stick(0.0, 0.0 if state.neutral_needed else 0.5)
            return abs(state.odometry.w) > 0.2

        until(turns, "turning again")
        robot.stop()

    def test_a_silent_robot_is_not_driven(self, master, bridges, tmp_path):
        master.start()
        robot = SimulatorProcess(master, tmp_path / "robot.log", "r", pose="2,1.8,0").wait_ready()
        hand = bridges(master).link()
        hand.state_until(drivable, "the robot")
        hand.take_control(1)
        robot.process.send_signal(signal.SIGSTOP)
        hand.stick(0.0, 0.5)
        hand.until(
            lambda r: (
                isinstance(r, wire.Status)
                and r.state.verdict.asked[2] > 0
                and r.state.verdict.allowed == (0.0, 0.0, 0.0)
            ),
            "the gate to hold",
        )
        time.sleep(0.4)  # a gap
        robot.process.send_signal(signal.SIGCONT)
        hand.stick(0.0, 0.0)
        state = hand.state_until(
            lambda state: drivable(state) and not state.neutral_needed, "the robot after the gap"
        )
        assert state.forgotten.code == "bridge_started", "a gap is no restart"
        robot.stop()
