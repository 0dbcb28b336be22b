"""Publishers that disagree, say nothing of their type, send rubbish or too much."""

from __future__ import annotations

import itertools
import json
import struct
import threading
import time

import psutil
import pytest
from std_msgs.msg import Float32, Int64, String

from robots.bridge.ros.inspector.definitions import parsed
from robots.bridge.tap.tap_server import BYTES_PER_S
from robots.shared.wire import LARGEST_BODY
from tests.processes import until
from tests.ros.strangers import Node, framed, text

THING = "int32 count\nstring word\n"
MEGABYTES = 1024 * 1024
MOST_GROWTH_BYTES = 150 * MEGABYTES


def said_by(message, **more):
    """Return what a publisher of this class says of it."""
    fields = {"type": message._type, "md5sum": message._md5sum, "message_definition": message._full_text}
    return fields | more


@pytest.fixture
def node(rosmaster):
    with Node(rosmaster.uri, "/stranger") as stranger:
        yield stranger


def repeated(message):
    return lambda: itertools.repeat(framed(message))


def test_only_one_type_of_a_topic_is_passed_on(tap, node, rosmaster):
    node.publish("/mixed", "std_msgs/String", repeated(text("word")), **said_by(String))
    tap.want(mixed="json")
    assert json.loads(tap.hears("mixed")) == {"data": "word"}
    with Node(rosmaster.uri, "/other") as other:
        other.publish("/mixed", "std_msgs/Int64", repeated(struct.pack("<q", 5)), **said_by(Int64))
        tap.want(mixed="json")
        other_said = tap.refuses("mixed", "publishers_differ")
        assert "std_msgs/String" in other_said.text
        until(lambda: other.sent > 5, "messages of the other type")
        assert set(tap.of("mixed", "json")) == {b'{"data":"word"}'}


def test_a_type_that_only_its_publisher_knows(tap, node):
    sum_ = parsed("lab_msgs/Thing", THING).md5
    says = {"type": "lab_msgs/Thing", "md5sum": sum_, "message_definition": THING}
    node.publish("/thing", "lab_msgs/Thing", repeated(struct.pack("<i", -3) + text("x")), **says)
    tap.want(thing="json")
    assert json.loads(tap.hears("thing")) == {"count": -3, "word": "x"}


def test_a_type_that_nobody_knows_is_passed_on_as_bytes(tap, node):
    says = {"type": "no_such_msgs/Thing", "md5sum": "0" * 32, "message_definition": ""}
    node.publish("/unknown", "no_such_msgs/Thing", repeated(b"abc"), **says)
    tap.want(unknown="json raw")
    tap.refuses("unknown", "type_unknown")
    assert tap.hears("unknown", "raw") == b"abc"
    assert not tap.of("unknown", "json")


def test_a_publisher_that_comes_back_with_another_type_is_read(tap, node):
    """The master's word of it may come before the end of the old connection. Then nobody says it again."""
    ends = threading.Event()

    def first():
        yield framed(text("one"))
        ends.wait()
        raise ConnectionError

    node.publish("/comes_back", "std_msgs/String", first, **said_by(String))
    tap.want(comes_back="json")
    assert json.loads(tap.hears("comes_back")) == {"data": "one"}
    tap.messages.clear()
    node._topics["/comes_back"] = repeated(struct.pack("<q", 5)), 10.0, said_by(Int64)
    ends.set()
    assert json.loads(tap.hears("comes_back")) == {"data": 5}


def test_a_broken_message_is_named_until_a_whole_one_comes(tap, node):
    whole, broken = framed(text("whole")), framed(b"\xff\xff\xff\xffshort")
    node.publish("/breaks", "std_msgs/String", lambda: itertools.cycle([whole, broken]), **said_by(String))
    tap.want(breaks="json")
    tap.refuses("breaks", "broken", "json")
    tap.hears("breaks")
    until(lambda: tap.states["/breaks", "json"].refusal is None, "the refusal ends")


def test_a_message_that_is_too_large_is_refused(tap, node):
    large = text("x" * (LARGEST_BODY + 1))
    node.publish("/large", "std_msgs/String", repeated(large), 2.0, **said_by(String))
    tap.want(large="raw")
    refusal = tap.refuses("large", "too_large", "raw")
    assert refusal.figures == {"bytes": len(large), "limit_bytes": LARGEST_BODY}


def test_floods_neither_grow_nor_delay_others(tap, node):
    """Ten thousand messages a second, and a topic as fast as it is read."""
    node.publish("/quiet", "std_msgs/String", repeated(text("quiet")), 20.0, **said_by(String))
    node.publish("/tiny", "std_msgs/Float32", repeated(struct.pack("<f", 1.0)), 10_000.0, **said_by(Float32))
    node.publish("/heavy", "std_msgs/String", repeated(text("x" * MEGABYTES)), 0.0, **said_by(String))
    tap.want(quiet="json", tiny="json", heavy="raw")
    for topic, form in (("quiet", "json"), ("tiny", "json"), ("heavy", "raw")):
        tap.hears(topic, form)
    process = psutil.Process(tap.process.pid)
    before, began_s = process.memory_info().rss, time.monotonic()
    counts = dict.fromkeys(("quiet", "tiny", "heavy"), 0)
    tap.messages.clear()
    newest = {}
    while time.monotonic() - began_s < 3.0:
        until(lambda: tap.messages, "messages")
        header, _ = tap.messages.popleft()
        counts[header.topic[1:]] += 1
        newest[header.topic] = header
    spent_s = time.monotonic() - began_s
    assert counts["quiet"] > 10 * spent_s
    assert counts["tiny"] < 1500 * spent_s
    assert counts["heavy"] * MEGABYTES < BYTES_PER_S * (spent_s + 2.5)
    assert process.memory_info().rss - before < MOST_GROWTH_BYTES
    assert time.time_ns() - newest["/tiny"].stamp_ns < 1e9, "old messages are dropped"
