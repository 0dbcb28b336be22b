"""A recorder: requests, the black box, changed types, and files with all that is needed to read them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

from robots.bridge.recorder.recorder_messages import (
    COMMAND,
    EVENT,
    Begin,
    Begun,
    ChainEvent,
    Command,
    Finished,
    Happened,
    InControl,
    Said,
)
from robots.recordings.files.contents import Contents
from robots.recordings.files.decoding import Decoder
from robots.shared import wire
from tests.processes import until
from tests.recorder_process import RecorderProcess, messages_of, said
from tests.sides.side import Side
from tests.sides.visitor import Speaker, Visitor

STRING, NUMBER, SCAN = "std_msgs/String", "std_msgs/Int64", "sensor_msgs/LaserScan"
JPEG = {"format": "jpeg", "data": [0xFF, 0xD8, 0xFF, 0xD9]}
FORMS = {"ros1": ("ros1msg", "ros1"), "ros2": ("ros2msg", "cdr")}  # of schemas, of messages

Publish = Callable[..., Speaker]


@pytest.fixture
def recorder(side: Side, robot: Any, tmp_path: Path) -> Iterator[RecorderProcess]:
    """A recorder; it ends with its robot."""
    process = RecorderProcess(side.config(tmp_path), side.environment(), tmp_path)
    yield process
    process.stop()


@pytest.fixture
def publish(visitor: Visitor) -> Iterator[Publish]:
    """``publish(topic, kind, **fields)`` publishes it for all who come later; ``hz=10``: ten times a second."""
    with ExitStack() as ending:

        def begin(topic: str, kind: str, hz: float = 0.0, **fields: Any) -> Speaker:
            speaker = ending.enter_context(visitor.speak(topic, kind, listeners=0, kept=not hz))
            speaker.repeat(hz, **fields) if hz else speaker.publish(**fields)
            return speaker

        yield begin


def part(recorder: RecorderProcess) -> bytes:
    """Return what the recording has so far: its channels, which are not compressed, come with their first messages."""
    (found,) = recorder.directory.glob("*.part")
    return found.read_bytes()


def test_a_recording_has_its_topics_and_the_chain(
    recorder: RecorderProcess, publish: Publish, side: Side
) -> None:
    publish("/words", STRING, data="kept")
    publish("/numbers", NUMBER, data=7)
    recording = recorder.begins(["/words"], reason="a report")
    recorder.say(said(3))
    begins = ChainEvent("control_begins", by="Ada")
    recorder.say(Said(EVENT, time.monotonic_ns(), msgspec.Raw(wire.encode(begins))))
    until(lambda: b"/words" in part(recorder), "the word")
    taken = recorder.finishes(recording)
    assert (taken.kind, taken.person, taken.reason, taken.cut) == ("by_hand", "person-1", "a report", False)
    found = messages_of(recorder.directory / taken.name)
    assert found.keys() == {"/words", COMMAND, EVENT}
    assert [msgspec.json.decode(data)["by"] for _, data in found[EVENT]] == ["…"]
    assert msgspec.json.decode(found[COMMAND][0][1], type=Command).drive.fence == 3
    assert {topic.topic: topic.messages for topic in taken.topics} == {"/words": 1, COMMAND: 1, EVENT: 1}
    with (recorder.directory / taken.name).open("rb") as stream:
        assert make_reader(stream).get_header().profile == side.ros.profile
        contents = Contents(stream)
        word = contents.newest("/words", contents.ends_ns)
        assert word is not None and word.schema is not None
        assert word.schema.name == side.type(STRING)
        assert (word.schema.encoding, word.channel.message_encoding) == FORMS[side.name]
        assert Decoder(word.channel, word.schema).read(word.message.data).data == "kept"


def test_everything_or_all_but_pictures(recorder: RecorderProcess, publish: Publish) -> None:
    publish("/words", STRING, data="kept")
    publish("/camera/compressed", "sensor_msgs/CompressedImage", hz=10, **JPEG)
    first = recorder.begins("pictures_not")
    publish("/later", NUMBER, hz=10, data=1)  # it begins while the recording goes on
    assert_records(recorder, first, {"/words", "/later"}, without="/camera/compressed")
    assert_records(recorder, recorder.begins("all"), {"/words", "/later", "/camera/compressed"})


def assert_records(recorder: RecorderProcess, recording: Any, topics: set[str], without: str = "") -> None:
    """End a recording when it has these topics: each file is read while it is written."""

    until(lambda: all(topic.encode() in part(recorder) for topic in topics), f"{topics} in {recording}")
    found = messages_of(recorder.directory / recorder.finishes(recording).name)
    assert topics <= found.keys() and without not in found


def test_a_second_recording_is_refused(recorder: RecorderProcess, publish: Publish) -> None:
    publish("/words", STRING, data="kept")
    recording = recorder.begins(["/words"])
    other = wire.LinkRecord(recording, 5.0, "all", "Bob", "person-2")
    recorder.say(Begin(other))
    refused = recorder.waits(Begun, lambda begun: begun.refusal is not None)
    assert refused.refusal.code == "recording_goes_on" and "Ada" in refused.refusal.text
    assert recorder.finishes(recording).person == "person-1"


def test_it_ends_with_the_slot(recorder: RecorderProcess, publish: Publish) -> None:
    publish("/words", STRING, data="kept")
    taken = recorder.finished(recorder.begins(["/words"], seconds=1.5))
    assert taken.ended_by == "The time for it was over." and taken.topics[0].messages == 1
    until(lambda: recorder.progress.recording is None, "no recording")


def test_a_type_that_changes_has_its_own_channel(
    recorder: RecorderProcess, visitor: Visitor, publish: Publish, side: Side
) -> None:
    kinds = [side.type(NUMBER), side.type(STRING)]
    with visitor.speak("/value", NUMBER, listeners=0, kept=True) as first:
        first.publish(data=4)
        recording = recorder.begins(["/value"])
        until(lambda: kinds[0].encode() in part(recorder), "the first type")
    publish("/value", STRING, data="four")
    until(lambda: kinds[1].encode() in part(recorder), "the second")
    taken = recorder.finishes(recording)
    assert [kind for kind, _ in messages_of(recorder.directory / taken.name)["/value"]] == kinds
    assert {(one.topic, one.type) for one in taken.topics} == {("/value", kind) for kind in kinds}


def test_the_black_box_keeps_what_was_before_an_event(recorder: RecorderProcess, publish: Publish) -> None:
    publish("/words", STRING, hz=10, data="not chosen")
    recorder.say(InControl("person-1", "session-1"))
    until(lambda: recorder.progress.black_box and recorder.progress.black_box.seconds >= 1, "a second of it")
    recorder.say(said(5))
    before = time.monotonic_ns()
    recorder.say(Happened("stop", before, "Stopped by Bob.", by="Bob"))
    recorder.say(Happened("gate", time.monotonic_ns(), "The gate held the robot back."))
    until(lambda: recorder.progress.black_box.keeps == "gate", "both events")
    recorder.process.stdin.close()  # the bridge ends: the file is finished now
    taken = recorder.waits(Finished).taken
    assert (taken.kind, taken.person, taken.session) == ("black_box", "person-1", "session-1")
    assert [(event.event, event.by) for event in taken.events] == [("stop", "Bob"), ("gate", "")]
    found = messages_of(recorder.directory / taken.name)
    assert {"/scan_raw", COMMAND} <= found.keys() and len(found["/scan_raw"]) >= 8
    assert "/words" not in found
    assert taken.begins < taken.events[0].at < taken.ends


def test_a_bumper_that_is_pressed_is_an_event(recorder: RecorderProcess, publish: Publish) -> None:
    bumper = publish("/bumper_front", "std_msgs/Bool", data=False)
    recorder.say(InControl("person-1", "session-1"))
    until(lambda: recorder.progress.black_box and recorder.progress.black_box.seconds, "the bumper")
    bumper.publish(data=True)
    until(lambda: recorder.progress.black_box.keeps == "contact", "the contact")
