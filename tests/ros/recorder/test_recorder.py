"""A recorder with a real rosmaster: requests, the black box, changed types, and what a kill leaves."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import msgspec
from sensor_msgs.msg import CompressedImage, LaserScan
from std_msgs.msg import Bool, Int64, String

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
from robots.shared import wire
from tests.processes import until
from tests.recorder_process import RecorderProcess, ends_with_its_robot, messages_of, said
from tests.ros.bridge_support import tiago_config


def test_a_recording_has_its_topics_and_the_chain(recorder, publish) -> None:
    publish("/words", String("kept"))
    publish("/numbers", Int64(7))
    recording = recorder.begins(["/words"], reason="a report")
    recorder.say(said(3))
    begins = ChainEvent("control_begins", by="Ada")
    recorder.say(Said(EVENT, time.monotonic_ns(), msgspec.Raw(wire.encode(begins))))
    until(lambda: recorder.bytes > 600, "bytes")
    taken = recorder.finishes(recording)
    assert (taken.kind, taken.person, taken.reason, taken.cut) == ("by_hand", "person-1", "a report", False)
    found = messages_of(recorder.directory / taken.name)
    assert found.keys() == {"/words", COMMAND, EVENT}
    assert [msgspec.json.decode(data)["by"] for _, data in found[EVENT]] == ["…"]
    assert [String().deserialize(data).data for _, data in found["/words"]] == ["kept"]
    assert msgspec.json.decode(found[COMMAND][0][1], type=Command).drive.fence == 3
    assert {topic.topic: topic.messages for topic in taken.topics} == {"/words": 1, COMMAND: 1, EVENT: 1}


def test_everything_or_all_but_pictures(recorder, publish) -> None:
    publish("/words", String("kept"))
    publish("/camera/compressed", CompressedImage(format="jpeg", data=b"\xff\xd8\xff\xd9"), latch=False)
    first = recorder.begins("pictures_not")
    publish("/later", Int64(1), latch=False)  # it begins while the recording goes on
    assert_records(recorder, first, {"/words", "/later"}, without="/camera/compressed")
    assert_records(recorder, recorder.begins("all"), {"/words", "/later", "/camera/compressed"})


def assert_records(recorder: RecorderProcess, recording: Any, topics: set[str], without: str = "") -> None:
    """End a recording when it has these topics: each file is read while it is written."""

    def has_all() -> bool:
        (part,) = recorder.directory.glob(f"*{recording}.part")
        return all(topic.encode() in part.read_bytes() for topic in topics)  # channels are not compressed

    until(has_all, f"{topics} in {recording}")
    found = messages_of(recorder.directory / recorder.finishes(recording).name)
    assert topics <= found.keys() and without not in found


def test_a_second_recording_is_refused(recorder, publish) -> None:
    publish("/words", String("kept"))
    recording = recorder.begins(["/words"])
    other = wire.LinkRecord(recording, 5.0, "all", "Bob", "person-2")
    recorder.say(Begin(other))
    refused = recorder.waits(Begun, lambda begun: begun.refusal is not None)
    assert refused.refusal.code == "recording_goes_on" and "Ada" in refused.refusal.text
    assert recorder.finishes(recording).person == "person-1"


def test_it_ends_with_the_slot(recorder, publish) -> None:
    publish("/words", String("kept"))
    taken = recorder.finished(recorder.begins(["/words"], seconds=1.5))
    assert taken.ended_by == "The time for it was over." and taken.topics[0].messages == 1
    until(lambda: recorder.progress.recording is None, "no recording")


def test_a_type_that_changes_has_its_own_channel(recorder, publish) -> None:
    first = publish("/value", Int64(4))
    recording = recorder.begins(["/value"])
    until(lambda: recorder.bytes > 600, "the first type")
    first.unregister()
    publish("/value", String("four"))
    until(lambda: b"std_msgs/String" in next(recorder.directory.glob("*.part")).read_bytes(), "the second")
    taken = recorder.finishes(recording)
    types = [type_ for type_, _ in messages_of(recorder.directory / taken.name)["/value"]]
    assert types == ["std_msgs/Int64", "std_msgs/String"]
    assert {(one.topic, one.type) for one in taken.topics} == {("/value", type_) for type_ in types}


def test_the_black_box_keeps_what_was_before_an_event(recorder, publish) -> None:
    publish("/scan_raw", LaserScan(ranges=[1.0, 2.0]), latch=False)
    publish("/words", String("not chosen"), latch=False)
    recorder.say(InControl("person-1", "session-1"))
    until(lambda: recorder.progress.black_box and recorder.progress.black_box.seconds >= 1, "a second of it")
    recorder.say(said(5))
    before = time.monotonic_ns()
    recorder.say(Happened("stop", before, "Stopped by Bob.", by="Bob"))
    recorder.say(Happened("gate", time.monotonic_ns(), "The gate held the robot back."))
    until(lambda: recorder.progress.black_box.keeps == "gate", "both events")
    assert recorder.process.stdin
    recorder.process.stdin.close()  # the bridge ends: the file is finished now
    taken = recorder.waits(Finished).taken
    assert (taken.kind, taken.person, taken.session) == ("black_box", "person-1", "session-1")
    assert [(event.event, event.by) for event in taken.events] == [("stop", "Bob"), ("gate", "")]
    found = messages_of(recorder.directory / taken.name)
    assert found.keys() == {"/scan_raw", COMMAND} and len(found["/scan_raw"]) >= 8
    assert taken.begins < taken.events[0].at < taken.ends


def test_a_bumper_that_is_pressed_is_an_event(recorder, publish) -> None:
    bumper = publish("/bumper_front", Bool(False))
    recorder.say(InControl("person-1", "session-1"))
    until(lambda: recorder.progress.black_box and recorder.progress.black_box.seconds, "the bumper")
    bumper.publish(Bool(True))
    until(lambda: recorder.progress.black_box.keeps == "contact", "the contact")


def test_recordings_end_with_the_master(make_master, tmp_path: Path) -> None:
    master = make_master()
    recorder = RecorderProcess(tiago_config(master, tmp_path), master.environment(), tmp_path)
    ends_with_its_robot(recorder, master.kill)
