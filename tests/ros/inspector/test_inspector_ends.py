"""The inspector drops its work after a halt, without its bridge, or when nobody waits for the result."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
import rosgraph
import rospy
from std_msgs.msg import Empty, String
from std_srvs.srv import SetBool, SetBoolResponse

from robots.bridge.ros.inspector import services
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.inspector.node import Node
from robots.bridge.ros.network.tcpros import connect_to_publisher
from robots.bridge.ros.tasks.publishing import heard_by
from robots.bridge.topics.inspector import requests
from robots.bridge.topics.inspector.declined import Declined
from robots.bridge.topics.inspector.publishing import Publishers, PublishPermit
from robots.bridge.topics.inspector.subscriptions import Subscriptions
from robots.bridge.topics.inspector_client import HALT_S
from robots.bridge.topics.inspector_messages import Check, HaltPublishing, InspectorQuery, KeepAlive
from robots.shared import wire
from robots.shared.ros.master import Master
from tests.inspector_process import InspectorProcess
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import tiago_config
from tests.ros.inspector.test_inspector import ALLOWED, order, serving, started, talking
from tests.ros.support import Inbox
from tests.ros.test_bridge import serves_deaf

NOTES = "/notes"


@pytest.fixture(scope="module")
def inspector(rosmaster, ros, tmp_path_factory) -> Iterator[InspectorProcess]:
    """An inspector that gets signs of life only from the test."""
    config = tiago_config(rosmaster, tmp_path_factory.mktemp("inspector"), allowed=ALLOWED)
    inspector = InspectorProcess(config, rosmaster.environment(), silent=True)
    yield inspector
    assert inspector.stop() == 0


@pytest.fixture
def ghost(rosmaster):
    """A registered subscriber of the notes that cannot be reached: messages wait a limited time for it."""
    master = rosgraph.Master("/ghost", rosmaster.uri)
    address = "http://127.0.0.1:1/"
    master.registerSubscriber(NOTES, "std_msgs/String", address)
    yield
    master.unregisterSubscriber(NOTES, address)


def note(text: str, rate_hz: float = 0.0) -> wire.Publish:
    return order(NOTES, "std_msgs/String", {"data": text}, rate_hz)


def checked(inspector: InspectorProcess, request: wire.Publish) -> None:
    assert inspector.done(lambda number: Check(number, request)) is None


def heard(inspector: InspectorProcess, notes: Inbox) -> str:
    """Send signs of life until a note arrives; return the note."""

    def attempt() -> Any:
        inspector.send(KeepAlive())
        with suppress(AssertionError):
            return notes.next(0.2).data

    return str(until(attempt, "a note"))


def test_a_message_waiting_for_listeners_is_dropped_at_a_halt(inspector, ros, ghost):
    checked(inspector, note("before"))
    with ros.listen(NOTES, String) as notes:
        inspector.send(note("before"))
        inspector.send(note("before, at a rate", 20.0))
        assert inspector.done(lambda number: HaltPublishing(number)) is None
        inspector.send(note("after"))
        assert notes.next().data == "after"
        assert notes.drain() == []


def test_a_halt_ends_publishing_at_a_rate(inspector, ros):
    checked(inspector, note("on and on", 50.0))
    with ros.listen(NOTES, String) as notes:
        inspector.send(note("on and on", 50.0))
        heard(inspector, notes)
        assert inspector.done(lambda number: HaltPublishing(number)) is None
        notes.drain()
        inspector.send(KeepAlive())
        with pytest.raises(AssertionError):
            notes.next(0.3)


def test_a_reader_of_nothing_is_cut_off(inspector, rosmaster, ros):
    large = note("x" * 100_000, 20.0)
    checked(inspector, large)
    with ros.listen(NOTES, String) as notes:
        inspector.send(large)
        heard(inspector, notes)
        master = Master(rosmaster.uri, "/deaf")
        (name,) = master.system_state().publishers[NOTES]
        node = master.node_uri(name)
        with connect_to_publisher(NOTES, node, "/deaf"):
            until(lambda: serves_deaf(node), "the deaf listener among the connections")
            until(lambda: inspector.send(KeepAlive()) or not serves_deaf(node), "its end")
        notes.drain()
        heard(inspector, notes)
        began_s = time.monotonic()
        assert inspector.done(lambda number: HaltPublishing(number)) is None
        assert time.monotonic() - began_s < HALT_S


def test_without_a_sign_of_life_nothing_is_published_at_a_rate(inspector, ros):
    checked(inspector, note("I live", 50.0))
    with ros.listen(NOTES, String) as notes:
        inspector.send(note("I live", 50.0))
        heard(inspector, notes)
        until_s = time.monotonic() + PATIENCE_S
        with pytest.raises(AssertionError, match="nothing on"):
            while time.monotonic() < until_s:
                notes.next(0.3)
        assert heard(inspector, notes) == "I live"
        assert inspector.done(lambda number: HaltPublishing(number)) is None


def test_requests_without_a_waiting_asker_are_dropped(inspector):
    calls = []
    with serving("/lamp", SetBool, lambda request: calls.append(request) or SetBoolResponse()):
        late_s = time.monotonic()
        assert inspector.ask(wire.CallService("/lamp", {"data": True}), late_s).refusal.code == "too_old"
        assert inspector.ask(wire.SetParameter("/greeting", "late"), late_s).refusal.code == "too_old"
        assert not rospy.has_param("/greeting") or rospy.get_param("/greeting") != "late"
        assert calls == []
        inspector.ask(wire.CallService("/lamp", {"data": True}), late_s + PATIENCE_S)
        assert len(calls) == 1


def test_a_call_that_became_too_late_is_not_sent(rosmaster, ros, tmp_path, monkeypatch):
    said: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    inspector = started(tiago_config(rosmaster, tmp_path, allowed=ALLOWED), said.put)
    find, calls = services.find, []

    def find_late(master, name):
        service = find(master, name)
        late.set()
        return service

    late = threading.Event()
    monkeypatch.setattr(services, "find", find_late)
    monkeypatch.setattr(InspectorQuery, "require_time", lambda _: late.is_set() and _too_late())
    with serving("/lamp", SetBool, lambda request: calls.append(request) or SetBoolResponse()):
        inspector.handle_line(wire.encode(InspectorQuery(1, wire.CallService("/lamp", {"data": True}), 0.0)))
        assert b"too_old" in said.get(timeout=PATIENCE_S)
    assert calls == []


def _too_late() -> None:
    raise requests.TooLate


def test_an_answer_with_a_too_long_line_is_refused(rosmaster, tmp_path, monkeypatch):
    said: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    inspector = started(tiago_config(rosmaster, tmp_path), said.put)
    monkeypatch.setattr(requests, "LARGEST_ANSWER", 100)
    inspector.handle_line(wire.encode(InspectorQuery(1, wire.Describe("std_msgs/String"))))
    assert b"too_large" in said.get(timeout=PATIENCE_S)


def test_a_sample_names_its_publishers(inspector):
    with talking("/look/who", Empty()):
        inspector.subscribe(**{"look/who": 10.0})
        shown = inspector.shown("/look/who", lambda s: s.number)
    inspector.subscribe()
    assert shown.publisher_names == [rospy.get_name()]


def test_a_subscription_by_a_page_is_no_listener(inspector, ros):
    with talking("/look/heard", String("hello")) as publisher:
        inspector.subscribe(**{"look/heard": 10.0})
        inspector.shown("/look/heard", lambda s: s.number)
        assert publisher.get_num_connections() == 1
        assert heard_by(publisher) == []
        with ros.listen("/look/heard", String) as inbox:
            inbox.next()
            assert len(heard_by(publisher)) == 1
    inspector.subscribe()


NEVER_HZ = 1e-300  # pages may not send this rate: the wait overflows, and the thread fails


@pytest.fixture
def given_up(monkeypatch) -> threading.Event:
    """Return an event that is set where the process would end."""
    event = threading.Event()
    monkeypatch.setattr(os, "_exit", lambda _status: event.set())
    return event


def test_with_the_thread_that_shows_topics_the_process_ends(rosmaster, ros, tmp_path, given_up):
    looks = Subscriptions(Node(Master(rosmaster.uri, "/test"), Definitions(tmp_path)), lambda *_: None)
    looks.set_subscriptions({"/look/never": NEVER_HZ})
    assert given_up.wait(PATIENCE_S)
    for look in looks._subscriptions.values():
        look.close()


def test_with_a_thread_that_publishes_the_process_ends(rosmaster, ros, tmp_path, given_up):
    definitions = Definitions(tmp_path)
    definition = definitions.of_type("std_msgs/String")
    talks = Publishers(Node(Master(rosmaster.uri, "/test"), definitions))
    talks.publish(NOTES, definition, lambda: definition.layout.write({}, (0, 0)), PublishPermit(), NEVER_HZ)
    assert given_up.wait(PATIENCE_S)


def test_a_message_checked_by_another_process_is_checked_again(rosmaster, ros, tmp_path):
    """An inspector that started after the check publishes only topics of the allow-list."""
    inspector = started(tiago_config(rosmaster, tmp_path, allowed=ALLOWED), lambda _: None)
    with pytest.raises(Declined):
        inspector._publish(wire.Publish(1, "/diary", "std_msgs/String"), PublishPermit())
    assert inspector._joined is None
