"""The bridge's side of its recorder: nothing that was asked is lost, and nothing goes on for ever."""

from __future__ import annotations

import asyncio
import time
from typing import Any
from uuid import uuid4

import msgspec
import pytest
from msgspec import structs

from robots.bridge.recorder import recorder_client
from robots.bridge.recorder.recorder_client import RecorderClient
from robots.bridge.recorder.recorder_messages import (
    EVENT,
    Begin,
    Begun,
    Continued,
    End,
    Happened,
    InControl,
    Kept,
    Lost,
    Over,
    Progress,
    RecorderRequest,
    Said,
)
from robots.shared import wire
from robots.shared.configuration.bridge_config import RecordingPlace
from robots.shared.wire import BlackBoxState, RecordingState
from tests.bridge.support import CONFIG, Bench

GRANT = wire.Grant(1, 60.0, "person-1", "Ada", "session-1", 1.0)
KEEP = wire.LinkKeep("Ada", "person-1")


class Child:
    """A process that reads when the test says so."""

    def __init__(self) -> None:
        self.listens = self.reads = True
        self.got: list[Any] = []

    def offer(self, line: bytes) -> bool:
        if self.reads and self.listens:
            self.got += [msgspec.json.decode(one, type=RecorderRequest) for one in line.split(b"\n")]
        return self.reads and self.listens

    def need(self) -> None:
        pass

    def kill(self, why: str) -> None:
        raise AssertionError(why)

    def all_of(self, kind: type[Any]) -> list[Any]:
        return [one for one in self.got if isinstance(one, kind)]


@pytest.fixture
def child() -> Child:
    return Child()


@pytest.fixture
def client(child, tmp_path) -> RecorderClient:
    config = structs.replace(CONFIG, recordings=RecordingPlace(str(tmp_path), 10**9, 0))
    client = RecorderClient(config, Bench().records)
    client._child = child
    client.began()
    return client


def order(seconds: float = 600.0) -> wire.LinkRecord:
    return wire.LinkRecord(uuid4(), seconds, "all", "Ada", "person-1")


def report(client: RecorderClient, message: msgspec.Struct) -> None:
    client.handle_line(wire.encode(message))


def begins(client: RecorderClient, wanted: wire.LinkRecord) -> None:
    client.record(wanted, lambda refusal: None, time.monotonic())
    report(client, Begun(wanted.recording))


async def test_requests_wait_for_a_process_that_reads_slowly(client, child) -> None:
    client.tick(GRANT, time.monotonic())
    report(client, Progress(None, BlackBoxState()))
    child.reads, wanted = False, order()
    for _ in range(3):
        client.refused(wire.Refusal("no", "No.", "wire"), "speech")
    client.tick(GRANT, time.monotonic())
    begins(client, wanted)
    client._happened("stop", "Stopped.", "Bob")
    client.keep(KEEP, lambda refusal: None)
    assert client.end(wanted.recording) is None
    client.tick(None, time.monotonic())
    child.reads = True
    client.tick(None, time.monotonic())
    requests = [type(one) for one in child.got if not isinstance(one, Said | Lost)]
    assert requests == [InControl, Begin, Happened, Happened, End, InControl]
    assert child.got[-1] == Lost(EVENT, 6)  # what the chain said meanwhile is missing, and counted


async def test_a_late_begin_is_ended_again(client, child, monkeypatch) -> None:
    monkeypatch.setattr(recorder_client, "ANSWER_S", 0.0)
    wanted, answered = order(), asyncio.get_running_loop().create_future()
    client.record(wanted, answered.set_result, time.monotonic())
    refusal = await answered
    assert refusal is not None and refusal.code == "recorder_silent"
    assert child.got == [Begin(wanted), End(wanted.recording)]
    report(client, Begun(wanted.recording))  # after all
    report(client, Over(wanted.recording))
    begins(client, order())


async def test_views_are_made_until_the_box_ends(client, child) -> None:
    assert not client.wants_view
    client.tick(GRANT, time.monotonic())
    report(client, Progress(None, BlackBoxState(seconds=9)))
    client.tick(None, time.monotonic())  # control has ended; what follows may be what somebody looks for
    assert client.wants_view
    report(client, Progress(None, None))
    assert not client.wants_view


async def test_a_recording_whose_time_ends_with_its_process_is_over(client, child) -> None:
    now_s = time.monotonic()
    for comes_back in (True, False):
        wanted = order(seconds=1.0)
        client.record(wanted, lambda refusal: None, now_s - 2.0)  # over since a second
        report(client, Begun(wanted.recording))
        report(client, Progress(RecordingState(wanted.recording, "by_hand", "Ada", "all", 1.0, 0.0), None))
        child.listens = False
        client.ended()
        if comes_back:
            child.listens = True
            client.began()
        else:
            client.tick(None, now_s)
        assert not client.wants_view and client.state()["recording"] is None
        child.listens = True


async def test_it_follows_a_recording_into_the_next_file(client, child) -> None:
    wanted, second = order(), uuid4()
    begins(client, wanted)
    report(client, Continued(wanted.recording, second))
    report(client, Begun(second))
    report(client, Over(wanted.recording))  # the first file
    other: list[Any] = []
    client.record(order(), other.append, time.monotonic())
    assert other[0].figures == {"recording": str(second)}
    client.ended()
    client.began()
    begin = child.all_of(Begin)[-1]
    assert begin.continues == second and begin.order.recording not in (wanted.recording, second)
    assert client.end(wanted.recording) is None  # by the number of the request
    assert child.all_of(End) == [End(begin.order.recording)]


async def test_keep_this_is_answered_when_its_file_is_open(client, child, monkeypatch) -> None:
    answers: list[str] = []

    def answer(refusal: wire.Refusal | None) -> None:
        answers.append(refusal.code if refusal else "kept")

    client.keep(KEEP, answer)
    client.tick(GRANT, time.monotonic())
    report(client, Progress(None, BlackBoxState(seconds=9)))
    client.keep(KEEP, answer)
    client.keep(KEEP, answer)
    assert answers == ["no_black_box"]
    full = wire.Refusal("disk_full", "Full.", "limits")
    for happened, refusal in zip(child.all_of(Happened), (None, full), strict=True):
        report(client, Kept(happened.at_ns, refusal))
    client.keep(KEEP, answer)
    child.listens = False
    client.ended()
    client.keep(KEEP, answer)
    assert answers[1:] == ["kept", "disk_full", "recorder_ended", "recorder_ended"]


async def test_a_refused_next_file_ends_the_recording_and_says_why(client, child) -> None:
    wanted, second = order(), uuid4()
    begins(client, wanted)
    state = RecordingState(wanted.recording, "by_hand", "Ada", "all", 1.0, 599.0)
    report(client, Progress(state, None))
    report(client, Continued(wanted.recording, second))
    report(client, Begun(second, wire.Refusal("disk_full", "Full.", "limits")))
    assert client.end(second) is not None and client.state()["recording"].refusal.code == "disk_full"
