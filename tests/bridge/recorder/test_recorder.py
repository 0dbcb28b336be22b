"""The recorder without a robot: which file an event belongs to, by which clock, and a recording of several files."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch
from uuid import UUID, uuid4

import pytest
from mcap.reader import make_reader
from msgspec import structs

from robots.bridge.recorder import recorder as module
from robots.bridge.recorder import take
from robots.bridge.recorder.black_box.ring import Message, Origin
from robots.bridge.recorder.recorder import Recorder, Wanted
from robots.bridge.recorder.recorder_messages import (
    EVENT,
    Begin,
    Continued,
    End,
    Finished,
    Happened,
    InControl,
    Kept,
    Lost,
    Over,
    Progress,
)
from robots.shared import wire
from robots.shared.configuration.bridge_config import RecordingPlace
from robots.shared.records.record_sink import TakenRecording
from tests.bridge.support import CONFIG
from tests.processes import until

ODOMETRY = Origin("/odom", "ros1", "nav_msgs/Odometry", "", "", "/base")
MAP = Origin("/map", "ros1", "nav_msgs/OccupancyGrid", "", "", "/server", latched=True)


class Bench:
    """A recorder, and what it reports."""

    def __init__(self, folder: Path) -> None:
        self.reports: list[Any] = []
        self.wanted = Wanted({})
        place = RecordingPlace(str(folder / "recordings"), 10**9, 0)
        self.recorder = Recorder(CONFIG, place, self.reports.append, self._follow)
        self.directory = self.recorder.directory.path

    def _follow(self, wanted: Wanted) -> None:
        self.wanted = wanted

    def tell(self, message: Any) -> None:
        self.recorder.handle_line(wire.encode(message))

    def arrives(self, origin: Origin = ODOMETRY, data: bytes = b"x") -> None:
        self.recorder.arrived(Message(origin, 1, time.monotonic_ns(), data))

    def all_of(self, kind: type[Any]) -> list[Any]:
        return [report for report in self.reports if isinstance(report, kind)]

    def finished(self, count: int = 1) -> list[TakenRecording]:
        until(lambda: len(self.all_of(Finished)) >= count, f"{count} files: {self.reports}")
        return [report.taken for report in self.all_of(Finished)]

    def topics_in(self, taken: TakenRecording) -> list[str]:
        with (self.directory / taken.name).open("rb") as stream:
            return [channel.topic for _, channel, _ in make_reader(stream).iter_messages()]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch) -> Iterator[Bench]:
    monkeypatch.setattr(take, "FLUSH_S", 0.02)
    bench = Bench(tmp_path)
    yield bench
    bench.recorder.close(5.0)


def happens(event: Any) -> Happened:
    return Happened(event, time.monotonic_ns(), f"It was a {event}.")


def test_an_event_while_the_last_box_is_finished_has_its_own(bench, monkeypatch) -> None:
    monkeypatch.setattr(module, "AFTER_S", 0.0)
    bench.tell(InControl("person-1"))
    bench.arrives()
    disk, is_slow = threading.Event(), threading.Event()

    def sync(stream: Any) -> None:
        is_slow.set()
        disk.wait(10)

    with patch.object(os, "fsync", sync):
        bench.tell(happens("stop"))
        assert is_slow.wait(10)
        bench.recorder.tick()  # the box ends, and waits for the disk
        bench.arrives()
        bench.tell(happens("gate"))
        disk.set()
        bench.recorder.tick()
        boxes = bench.finished(2)
    assert sorted(event.event for box in boxes for event in box.events) == ["gate", "stop"]
    assert bench.all_of(Progress)[-1].black_box.kept == 2
    assert [bench.topics_in(box) for box in boxes if box.events[0].event == "gate"] == [["/odom"] * 2]


def test_all_events_of_a_box_have_the_clock_of_its_file(bench) -> None:
    bench.tell(InControl("person-1"))
    bench.arrives()
    bench.tell(happens("stop"))
    real = time.time_ns
    with patch("time.time_ns", lambda: real() + 3600 * 10**9):  # somebody sets the time of day
        bench.tell(happens("gate"))
    bench.recorder.close(5.0)
    (box,) = bench.finished()
    stop, gate = box.events
    assert 0.0 <= gate.at - stop.at < 60.0


def test_a_recording_says_who_had_control_when_by_its_own_clock(bench) -> None:
    bench.tell(InControl("person-1", "session-1"))
    bench.arrives()
    order = wire.LinkRecord(uuid4(), 600.0, "all", "Ada", "person-1")
    bench.tell(Begin(order))
    real = time.time_ns
    with patch("time.time_ns", lambda: real() + 3600 * 10**9):  # somebody sets the time of day
        bench.tell(InControl("person-2", "session-2"))
        bench.arrives()
        bench.tell(happens("stop"))
        bench.tell(InControl())
        bench.arrives()
        bench.recorder.close(5.0)
    for taken in bench.finished(2):
        first, second = taken.controls
        assert (first.session, second.session) == ("session-1", "session-2")
        assert first.ends == second.begins < second.ends <= taken.ends
        assert taken.begins - 1.0 < first.ends < taken.begins + 60.0


def test_a_recording_on_request_has_its_events_also_without_control(bench) -> None:
    order = wire.LinkRecord(uuid4(), 600.0, "all", "Ada", "person-1")
    bench.tell(Begin(order))
    bench.arrives()
    bench.tell(happens("stop"))
    bench.tell(InControl("person-2"))
    bench.arrives(Origin("/bumper", "ros1", "std_msgs/Bool", "", "", "/base"), b"\x01")
    bench.tell(End(order.recording))
    bench.recorder.close(5.0)
    events = {taken.kind: [event.event for event in taken.events] for taken in bench.finished(2)}
    assert events == {"by_hand": ["stop", "contact"], "black_box": ["contact"]}


def test_lines_that_the_bridge_could_not_send_are_in_the_box(bench) -> None:
    bench.tell(InControl("person-1"))
    bench.arrives()
    bench.tell(Lost(EVENT, 3))
    bench.tell(happens("stop"))
    bench.tell(Lost(EVENT, 2))
    bench.recorder.close(5.0)
    (box,) = bench.finished()
    assert {topic.topic: topic.dropped for topic in box.topics} == {"/odom": 0, EVENT: 5}


def test_an_event_is_answered_with_its_file_or_why_there_is_none(bench) -> None:
    bench.tell(InControl("person-1"))
    bench.arrives()
    first, second, third = happens("keep"), happens("keep"), happens("keep")
    for event in (first, second):
        bench.tell(event)
    until(lambda: len(bench.all_of(Kept)) == 2, "answers")
    bench.recorder.close(5.0)
    with patch.object(bench.recorder.directory, "_free_on_disk", return_value=0):
        bench.tell(third)
        until(lambda: len(bench.all_of(Kept)) == 3, "a refusal")
    codes = [(one.at_ns, one.refusal and one.refusal.code) for one in bench.all_of(Kept)]
    assert codes == [(first.at_ns, None), (second.at_ns, None), (third.at_ns, "disk_full")]


def test_a_recording_goes_on_in_a_new_file_when_one_is_full(bench, monkeypatch) -> None:
    monkeypatch.setattr(take, "MOST_INDEX_BYTES", 1)
    order = wire.LinkRecord(uuid4(), 600.0, "all", "Ada", "person-1", reason="a day")
    bench.tell(Begin(order))
    bench.arrives(MAP)
    for number in range(3):
        bench.arrives()
        until(lambda: bench.recorder._order.take.is_full, "a full file")
        before = bench.all_of(Progress)
        bench.recorder.tick()
        assert len(bench.all_of(Continued)) == number + 1 and len(bench.all_of(Progress)) > len(before)
    state = bench.all_of(Progress)[-1].recording
    assert state.bytes > 2000 and state.since_s < 60  # of all files
    first = bench.all_of(Continued)[0]
    bench.tell(End(first.recording))  # the bridge had not read yet that it goes on elsewhere
    files = {taken.recording: taken for taken in bench.finished(4)}
    chain: list[UUID] = [order.recording, *(one.by for one in bench.all_of(Continued))]
    assert [files[one].continues for one in chain] == [None, *chain[:-1]]
    assert [bench.topics_in(files[one]) for one in chain] == [["/map", "/odom"]] * 3 + [["/map"]]
    assert {taken.reason for taken in files.values()} == {"a day"}
    told = [report for report in bench.reports if isinstance(report, Continued | Over)]
    assert told[0] == first and isinstance(told[1], Continued | Over)
    bench.recorder.tick()
    assert bench.all_of(Progress)[-1].recording is None
    bench.tell(Begin(structs.replace(order, recording=uuid4())))
    assert bench.wanted.others == "all"


def test_topics_that_are_left_out_are_told_and_noted(bench) -> None:
    order = wire.LinkRecord(uuid4(), 600.0, "all", "Ada", "person-1")
    bench.tell(Begin(order))
    bench.arrives()
    for count in (0, 7, 5):  # some of them have gone
        bench.recorder.left_out(count)
    bench.recorder.tick()
    assert bench.all_of(Progress)[-1].recording.left_out == 7
    bench.tell(End(order.recording))
    assert bench.finished()[0].left_out == 7
