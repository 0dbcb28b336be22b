"""The robot's topics over the link: every link subscribes; the holder of control publishes, after the record."""

from __future__ import annotations

import itertools
import signal
import time
from contextlib import closing
from typing import Any

import msgspec
import psutil
import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from tests.messages import Messages
from tests.processes import until
from tests.ros.bridge_support import BridgeProcess, Hand, drivable

STRING, POSE = "std_msgs/String", "geometry_msgs/PoseStamped"
ODOMETRY = "/mobile_base_controller/odom"

_numbers = itertools.count(1000)
_answer = msgspec.json.Decoder(wire.TopicAnswer)


@pytest.fixture(scope="module")
def bridge(side, robot, tmp_path_factory):
    allowed = (
        Allowed("publish", "/notes", side.type(STRING)),
        Allowed("publish", "/visit_pose", side.type(POSE)),
    )
    config = side.config(tmp_path_factory.mktemp("topics"), "motions", allowed=allowed)
    process = BridgeProcess(config, side, tmp_path_factory.mktemp("bridge"))
    yield process
    process.stop()


@pytest.fixture
def hand(bridge):
    with closing(bridge.link()) as hand:
        hand.state_until(drivable, "a robot that can be driven")
        yield hand


@pytest.fixture
def holder(hand):
    """A link in control, with a fence that grows from test to test."""
    hand.take_control(time.time_ns() // 1_000_000)
    yield hand
    hand.send(wire.Revoke(hand.fence, "the test is over"))
    hand.until(lambda report: isinstance(report, wire.Ended), "the end of control")


def inspector_of(bridge: BridgeProcess) -> psutil.Process:
    (process,) = inspectors_of(bridge)
    return process


def inspectors_of(bridge: BridgeProcess) -> list[psutil.Process]:
    return psutil.Process(bridge.process.pid).children()


def ended(process: psutil.Process) -> bool:
    """Return whether the process has ended. A zombie counts as ended: its parent may not reap it."""
    try:
        return bool(process.status() == psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return True


def ask(hand: Hand, question: Any) -> Any:
    seq = next(_numbers)
    hand.send(wire.LinkQuery(seq, question))
    inspected = hand.until(
        lambda report: isinstance(report, wire.LinkAnswer) and report.seq == seq, "an answer"
    )
    return _answer.decode(inspected.answer)


def topics(hand: Hand) -> set[str]:
    return {row.name for row in ask(hand, wire.ListTopics()).topics}


def shown(hand: Hand, topic: str) -> wire.Sample:
    seen = hand.until(
        lambda report: isinstance(report, wire.LinkSample) and report.topic == topic, f"{topic} seen"
    )
    return msgspec.json.decode(seen.sample, type=wire.Sample)


def falls_silent(inbox: Messages) -> None:
    """Check that no more messages come. Some may still be on the way."""
    inbox.drain()
    with pytest.raises(AssertionError, match="nothing on"):
        for _ in range(5):
            inbox.next(0.3)


def test_topics_and_actions_are_listed_and_shown_on_every_link(side, bridge, hand):
    assert ODOMETRY in topics(hand)
    action = wire.ActionRow(side.topics.motions.name, side.topics.motions.type)
    # DDS tells of services after topics.
    until(lambda: action in ask(hand, wire.ListTopics()).actions, "the action")
    graph = ask(hand, wire.ListTopics())
    assert not [row.name for row in graph.services if "/_action/" in row.name]
    with closing(bridge.link()) as other:
        for link in (hand, other):
            link.send(wire.LinkSubscribe({ODOMETRY: 10.0}))
        for link in (hand, other):
            assert shown(link, ODOMETRY).fields["header"]["frame_id"] == "odom"


def test_the_holder_publishes_by_allow_list_recorded(bridge, holder, side, visitor):
    fence = holder.fence
    with visitor.listen("/notes", STRING) as notes, visitor.listen("/visit_pose", POSE) as poses:
        until(lambda: "/notes" in topics(holder), "the listener")
        note = wire.Publish(fence, "/notes", side.type(STRING), {"data": "hello"}, seq=101)
        assert holder.ask(note) is None
        assert notes.next().data == "hello"
        assert any(line.startswith("publish.start /notes") for line in bridge.recorded())
        pose = wire.Publish(fence, "/visit_pose", side.type(POSE), {"pose.position.x": 2}, 20.0, seq=102)
        assert holder.ask(pose) is None
        assert poses.next().pose.position.x == 2.0
        publishing = holder.state_until(lambda state: state.publishing, "a publishing").publishing
        assert publishing == [wire.Publishing("/visit_pose", side.type(POSE), 20.0)]
        assert holder.ask(wire.PublishStop(fence, "/visit_pose", seq=103)) is None
        holder.state_until(lambda state: not state.publishing, "its end")


def test_forbidden_messages_are_refused_before_recording(bridge, holder, side):
    fence = holder.fence
    before = bridge.records.read_text()
    bad = wire.Publish(fence, "/notes", side.type(STRING), {"data": 5}, seq=111)
    assert holder.ask(bad).figures == {"path": "data"}
    other = wire.Publish(fence, "/diary", side.type(STRING), {}, seq=112)
    assert holder.ask(other).code == "not_allowed"
    around = wire.Publish(fence, "/nav_vel", side.type("geometry_msgs/Twist"), {}, seq=113)
    assert holder.ask(around).code == "around_the_gate"
    old = wire.Publish(1, "/notes", side.type(STRING), {}, seq=114)
    assert holder.ask(old) is not None
    assert bridge.records.read_text() == before


def test_an_emergency_stop_ends_publishing(bridge, holder, side, visitor):
    fence = holder.fence
    with visitor.listen("/notes", STRING) as notes:
        order = wire.Publish(fence, "/notes", side.type(STRING), {"data": "on"}, 50.0, seq=121)
        assert holder.ask(order) is None
        notes.next()
        holder.send(wire.LinkStop("Ann", seq=122))
        stopped = holder.until(
            lambda report: isinstance(report, wire.Stopped) and report.seq == 122, "a stop"
        )
        holder.state_until(lambda state: not state.publishing, "the end of it")
        falls_silent(notes)
    holder.send(wire.LinkClear("Ann", stopped.stop.number, seq=123))
    holder.until(lambda report: isinstance(report, wire.Stopped) and report.seq == 123, "a clear")


def test_a_dead_inspector_is_replaced_without_publishing(bridge, holder, side, visitor):
    with visitor.listen("/notes", STRING) as notes:
        order = wire.Publish(holder.fence, "/notes", side.type(STRING), {"data": "on"}, 50.0, seq=131)
        holder.send(wire.LinkSubscribe({ODOMETRY: 10.0}))
        assert holder.ask(order) is None
        notes.next()
        first = inspector_of(bridge)
        first.send_signal(signal.SIGKILL)
        holder.state_until(lambda state: not state.publishing, "the end of what it published")
        shown(holder, ODOMETRY)
        until(lambda: inspectors_of(bridge) not in ([], [first]), "another inspector")
        number = until(lambda: shown(holder, ODOMETRY).number, "its messages")
        assert number > 0
        falls_silent(notes)
    assert "publish.end inspector_ended" in bridge.records.read_text()


@pytest.mark.last
def test_a_bridge_that_is_killed_takes_its_inspector_along(bridge, hand):
    hand.send(wire.LinkSubscribe({ODOMETRY: 10.0}))
    shown(hand, ODOMETRY)
    inspector = inspector_of(bridge)
    bridge.kill()
    hand.close()
    until(lambda: ended(inspector), "the end of the inspector")
