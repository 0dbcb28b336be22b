"""Bridges record by the records process of their computer."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, cast
from unittest import mock
from uuid import uuid4

import numpy
import pytest

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from robots.bridge.audit.remote_sink import remote_sink
from robots.records.record_server import serve
from robots.registry.models import Robot
from robots.shared.geometry.poses import STILL, Pose
from robots.shared.records import calls
from robots.shared.records.record_sink import (
    BadRecord,
    DriveSummary,
    FileCut,
    GateStart,
    GateSummary,
    Holder,
    KeptEvent,
    Position,
    RecordedTopic,
    RecordError,
    RecordSink,
    Sample,
    TakenDescription,
    TakenMap,
    TakenRecording,
)
from robots.shared.records.verdict import SpeedLimit, Verdict
from robots.shared.sentences import Sentence, say
from tests.processes import until

WHY = say("{sensor} is {age:age} old", sensor=say("laser"), age=0.61)
START = Position(Pose(1.0, 2.0, 3.0), None)
LIMIT = SpeedLimit("blind", "blind", 0.3, "left")
HELD = Verdict(STILL, STILL, "stale", WHY, "laser", 0.5, side="ahead", point=(1.0, 2.0), limits=(LIMIT,))
TOPIC, EVENT = RecordedTopic("/tf", "tf2_msgs/TFMessage", 5), KeptEvent("stop", 1.5, WHY, "Ada")
HOLDER = Holder("7", "Ada", str(uuid4()), 3)
DRIVE = DriveSummary("halted", WHY, START, 1.0, 2.0, 0.3, 0.4, 1, [Sample(0.1, 1.0, 2.0, 3.0, 0.3)], 0.02)
TAKEN = TakenRecording(uuid4(), "r", "by_hand", 1.0, 2.0, 9, "/var", "a", [TOPIC], [EVENT], continues=uuid4())
CALLS: dict[str, tuple[Any, ...]] = {
    "settle": (),
    "test_writable": (),
    "begin_drive": (HOLDER, START),
    "end_drive": (1, HOLDER, DRIVE),
    "request": (HOLDER, "speech.say", {"text": "Hello", "duration_s": 1.5, "language": None}),
    "outcome": (1, None, "speech.end", "done", {"text": WHY, "duration_s": numpy.float64(0.5)}),
    "begin_gate": (1, HOLDER, GateStart(HELD, 0.5, None)),
    "stopped": (None, 12, True),
    "end_gate": (1, HOLDER, GateSummary(0.5, ["stale"], HELD, Pose(1.0, 2.0, 3.0))),
    "ill_parts": (),
    "keep_map": (TakenMap(0.05, Pose(0.0, 0.0, 0.0), 3, 2, b"\x89PNG", "digest"),),
    "keep_recording": (TAKEN,),
    "drop_recording": (uuid4(),),
    "recording_changes": (uuid4(),),
    "recording_changed": (uuid4(), "keep"),
    "recording_cuts": (uuid4(),),
    "recording_cut": (FileCut(TAKEN, [(0, 2**63 - 1)]),),
    "keep_description": (TakenDescription("digest", b"\x00", "no joints"),),
}


@pytest.mark.parametrize("method", [name for name in vars(RecordSink) if not name.startswith("_")])
def test_a_call_arrives_as_it_was_made(method: str) -> None:
    assert calls.call_of(calls.encode((method, CALLS[method]))) == (method, CALLS[method])


def test_a_sentence_keeps_its_figures() -> None:
    _, (_, _, start) = calls.call_of(calls.encode(("begin_gate", CALLS["begin_gate"])))
    assert isinstance(start.verdict.text, Sentence)
    assert start.verdict.text.parts == WHY.parts


class Process:
    """The records process, as a thread."""

    def __init__(self, path: Path) -> None:
        self._ended = threading.Event()
        self.thread = threading.Thread(target=serve, args=(path, self._ended))
        self.thread.start()
        until(path.exists, "its socket")

    def end(self) -> None:
        self._ended.set()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / calls.SOCKET


@pytest.fixture
def start(path: Path) -> Iterator[Callable[[], Process]]:
    started: list[Process] = []
    yield lambda: started.append(Process(path)) or started[-1]  # type: ignore[func-returns-value]
    for process in started:
        process.end()
        process.thread.join()


@pytest.fixture
def sink(robot: Robot, path: Path) -> Iterator[RecordSink]:
    sink = remote_sink(str(path), str(robot.id), robot.name)
    yield sink
    _disconnect(sink)


def _disconnect(sink: RecordSink) -> None:
    if connection := cast(Any, sink)._connection:
        connection.close()
        cast(Any, sink)._connection = None


@pytest.fixture
def holder(operator: User) -> Holder:
    return Holder(str(operator.pk), "Olga Operator", str(uuid4()), 5)


@pytest.mark.django_db(transaction=True)
def test_records_and_refusals_cross_the_socket(
    start: Callable[[], Process], sink: RecordSink, holder: Holder
) -> None:
    start()
    sink.settle()
    drive = sink.begin_drive(holder, START)
    sink.end_drive(drive, holder, DRIVE)
    begin, end = Record.objects.filter(kind__startswith="drive").order_by("id")
    assert (begin.pk, end.of_id) == (drive, drive)
    assert end.content.data["said"] == WHY.parts
    with pytest.raises(BadRecord, match="refuses"):
        sink.begin_drive(Holder("7", "Ada", "no session", 1), START)
    full = AuditUnavailable("audit_disk_full", "The disk is full.")
    with (
        mock.patch("robots.records.bridge_records.record", side_effect=full),
        pytest.raises(RecordError) as e,
    ):
        sink.begin_drive(holder, START)
    assert not isinstance(e.value, BadRecord)
    with (
        mock.patch("robots.records.bridge_records.record", side_effect=LookupError),
        pytest.raises(BadRecord),
    ):
        sink.begin_drive(holder, START)
    assert sink.begin_drive(holder, START) > drive


@pytest.mark.django_db(transaction=True)
def test_the_end_waits_for_bridges_and_the_next_one_is_found(
    start: Callable[[], Process], sink: RecordSink, path: Path
) -> None:
    with pytest.raises(RecordError, match="does not run"):
        sink.test_writable()
    first = start()
    sink.test_writable()
    first.end()
    second = start()  # of the next supervisor, at the same path
    sink.test_writable()
    assert first.thread.is_alive()
    _disconnect(sink)
    first.thread.join()
    sink.test_writable()
    _disconnect(sink)
    second.end()
    second.thread.join()
    assert not path.exists()


@pytest.mark.django_db(transaction=True)
def test_rospys_limit_for_sockets_does_not_count(start: Callable[[], Process], sink: RecordSink) -> None:
    socket.setdefaulttimeout(5.0)
    try:
        start()
        sink.settle()
    finally:
        socket.setdefaulttimeout(None)


def test_a_robot_without_a_process_is_told_so(path: Path) -> None:
    sink = remote_sink(str(path), str(uuid4()), "Robot")
    for call in (partial(getattr(sink, method), *CALLS[method]) for method in CALLS):
        with pytest.raises(RecordError, match="the process that writes the audit log does not run"):
            call()
