"""The master monitor: any answer of the master; a silent or dead master or bridge of another console."""

from __future__ import annotations

import itertools
import queue
import signal
import socket
from contextlib import contextmanager

import pytest
import rospy

from robots.bridge.ros.network import master_monitor
from robots.bridge.ros.network.master_monitor import SILENCE_S, MasterMonitor
from robots.shared.configuration.bridge_config import Topic
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.processes.shutdown import EXIT_NOT_JOINED
from robots.shared.ros.master import Master, node_alive
from tests.processes import PATIENCE_S, free_port
from tests.ros.bridge_support import BridgeProcess, drivable, tiago_config
from tests.ros.network.test_hostile_nodes import answering
from tests.ros.sensors.test_posture import reach_out
from tests.ros.spoiled_master import CUT_SHORT, answer_of, spoiling
from tests.ros.support import RosClient
from tests.ros.tiago_arm import ARM, JOINT_STATES


@pytest.fixture(scope="module", autouse=True)
def robot(rosmaster, simulator):
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@pytest.fixture
def bridges(tmp_path):
    started = []

    def start(master, **topics):
        started.append(BridgeProcess(tiago_config(master, tmp_path, topics=topics), master, tmp_path))
        return started[-1]

    yield start
    for bridge in started:
        bridge.stop()


class NotingNode:
    """The monitor's node: stores its calls in order. Each `join` also calls the next function of `begins`."""

    def __init__(self, *begins) -> None:
        self._begins = list(begins)
        self._heard = queue.SimpleQueue()

    def join(self) -> None:
        if self._begins:
            self._begins.pop(0)()
        self._heard.put("begun")

    def restarting(self) -> None:
        self._heard.put("begins again")

    def restarted(self) -> None:
        self._heard.put("begun again")

    def surveyed(self, system) -> None:
        self._heard.put("surveyed")

    def report(self, status) -> None:
        self._heard.put(f"{status.phase}: {status.text}")

    def lost(self, name_taken: bool) -> None:
        self._heard.put(f"lost, name taken: {name_taken}")

    def next(self) -> str:
        return self._heard.get(timeout=PATIENCE_S)

    def until(self, wanted: str) -> list[str]:
        """Wait for this call; return the calls before it."""
        before = []
        while (heard := self.next()) != wanted:
            before.append(heard)
        return before


@contextmanager
def watching(uri: str, node: NotingNode):
    """Run a master monitor."""
    watch = MasterMonitor(Master(uri, BRIDGE), node)
    watch.start()
    try:
        yield
    finally:
        watch.close()
        watch._thread.join(PATIENCE_S)


@pytest.fixture
def soon(monkeypatch):
    monkeypatch.setattr(master_monitor, "RETRY_S", 0.01)
    monkeypatch.setattr(master_monitor, "SURVEY_S", 0.01)


def test_rubbish_from_the_master_halts_until_it_recovers(bridges, rosmaster):
    with spoiling(rosmaster) as master:
        hand = bridges(master).link()
        hand.state_until(drivable, "the robot")
        for method, answer in (
            ("getSystemState", answer_of(5)),
            ("lookupNode", answer_of("http://[nowhere")),
            ("lookupNode", answer_of(f"http://{'a' * 64}.b/")),
        ):
            master.spoiled[method] = answer
            waiting = hand.state_until(
                lambda state: state.phase == "waiting" or "alias" in state.text or "ROS_IP" in state.text,
                method,
            )
            assert waiting.text
            master.spoiled.clear()
            hand.state_until(drivable, f"the robot, after {method}")
        hand.close()


def test_a_description_that_was_cut_short_is_asked_for_again(ros, bridges, rosmaster):
    with spoiling(rosmaster) as master:
        master.spoiled["/robot_description"] = CUT_SHORT
        hand = bridges(master, arm=ARM, joint_states=JOINT_STATES).link()
        hand.state_until(drivable, "the robot")
        reach_out(ros)
        master.spoiled.clear()
        hand.state_until(lambda state: state.arm, "where its arm is, by its description")
        hand.close()


def test_a_base_with_another_type_still_counts_as_listener(bridges, rosmaster):
    hand = bridges(rosmaster, drive=Topic("/key_vel", "geometry_msgs/TwistStamped")).link()
    state = hand.state_until(lambda state: "does not connect" in state.text, "who listens")
    assert state.phase == "connecting"
    assert state.text.startswith("/simulator_tiago_1 listens to /key_vel and does not connect: it takes no ")
    hand.close()


@pytest.mark.parametrize(
    ("hangs", "words"), [(False, "its process has ended"), (True, "it does not answer at http")]
)
def test_a_dead_node_is_not_blamed_on_type_or_address(bridges, rosmaster, hangs, words):
    with socket.create_server(("127.0.0.1", 0)) as server:
        uri = f"http://127.0.0.1:{server.getsockname()[1]}/"
        if not hangs:
            server.close()
        base = Master(rosmaster.uri, "/base")
        base.register("registerSubscriber", "/dead_vel", "geometry_msgs/Twist", uri)
        try:
            hand = bridges(rosmaster, drive=Topic("/dead_vel", "geometry_msgs/Twist")).link()
            state = hand.state_until(lambda state: words in state.text, words)
            assert state.text.startswith("/base should listen to /dead_vel, but ")
            hand.close()
        finally:
            base.call("unregisterSubscriber", "/dead_vel", uri)


def test_a_half_joined_bridge_ends_so_that_another_joins(bridges, rosmaster):
    bridge = bridges(rosmaster, speech=Topic("/tts", "std_msgs/Bool"))  # wrong type for a voice
    assert bridge.process.wait(PATIENCE_S) == EXIT_NOT_JOINED
    assert "KeyError: 'std_msgs/Bool'" in bridge.log.read_text()


def test_a_failed_task_is_not_repeated_in_the_process(rosmaster, soon):
    def full() -> None:
        raise OSError(28, "No space left on device")

    node = NotingNode(full)
    with watching(rosmaster.uri, node):
        before = node.until("lost, name taken: False")
    assert before == ["refused: The bridge could not join the robot ([Errno 28] No space left on device)."]


def test_a_master_restarted_during_joining_gets_everything(make_master, soon, monkeypatch):
    master = make_master()
    again = []
    monkeypatch.setattr(master_monitor, "register_again", lambda *node: again.append(node))

    def restart() -> None:
        master.kill()
        master.start()

    node = NotingNode(restart)
    with watching(master.uri, node):
        assert "begins again" in node.until("begun again")
    assert len(again) == 1


def test_the_master_monitor_survives_its_failures(rosmaster, soon, monkeypatch):
    class Failing(NotingNode):
        def surveyed(self, system) -> None:
            super().surveyed(system)
            monkeypatch.setattr(Failing, "surveyed", NotingNode.surveyed)
            raise RecursionError("of what a master answered")

    monkeypatch.setattr(master_monitor, "register_again", lambda *_: None)
    node = Failing()
    with watching(rosmaster.uri, node):
        node.until("waiting: Watching the robot’s ROS master failed (of what a master answered).")
        node.until("begun again")
        node.until("surveyed")


class TestNamesake:
    """Another console has a bridge for this robot: this bridge must find out whether the other one is alive."""

    def test_one_that_hangs_for_a_while_keeps_the_robot(self, bridges, rosmaster):
        first, second = bridges(rosmaster), None
        hand = first.link()
        try:
            hand.state_until(drivable, "the robot")
            second = bridges(rosmaster).link()
            second.state_until(lambda state: "drives this robot" in state.text, "a refusal")
            first.process.send_signal(signal.SIGSTOP)
            state = second.state_until(
                lambda state: "drives this robot" not in state.text, "its silence seen"
            )
            assert (state.phase, "does not answer" in state.text) == ("refused", True)
            first.process.send_signal(signal.SIGCONT)
            second.state_until(lambda state: "drives this robot" in state.text, "a refusal again")
            hand.state_until(drivable, "the first one's robot")
            assert first.process.poll() is None
        finally:
            first.process.send_signal(signal.SIGCONT)
            hand.close()
            if second:
                second.close()

    def test_only_silence_without_a_break_is_a_death(self, rosmaster, soon, monkeypatch):
        clock = itertools.count(100.0)  # each reading is one second later
        patient = int(SILENCE_S)
        answers = [*[None] * patient, True, *[None] * patient, None]
        monkeypatch.setattr(master_monitor, "monotonic", lambda: next(clock))
        monkeypatch.setattr(Master, "node_uri", lambda *_: "http://elsewhere:1/")
        monkeypatch.setattr(master_monitor, "node_alive", lambda *_: answers.pop(0))
        node = NotingNode()
        with watching(rosmaster.uri, node):
            before = node.until("begun")
        assert answers == []
        silent = ["does not answer" in text for text in before]
        assert silent == [*[True] * patient, False, *[True] * patient]

    def test_only_a_silent_bridge_may_still_live(self, ros: RosClient):
        own = rospy.get_node_uri()
        with socket.create_server(("127.0.0.1", 0)) as silent, answering(b"hello") as other:
            assert node_alive(f"http://127.0.0.1:{silent.getsockname()[1]}/", BRIDGE) is None
            assert node_alive("http://no-such-computer.invalid:1/", BRIDGE) is True
            assert node_alive(f"http://127.0.0.1:{free_port()}/", BRIDGE) is False
            assert node_alive(other, BRIDGE) is False
            assert node_alive(own, BRIDGE) is False
            assert node_alive(own, rospy.get_name()) is True
