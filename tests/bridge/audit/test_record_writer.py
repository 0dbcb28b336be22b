"""Requests are written or refused; events are written in order, possibly later."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator

import pytest

from robots.bridge.audit.record_writer import RecordWriter
from robots.shared.records.record_sink import BadRecord, RecordError


class Log:
    """A database with one table, which can fail or hang."""

    def __init__(self) -> None:
        self.rows: list[str] = []
        self.pulses = 0
        self.away: str | None = None
        self.answers = threading.Event()
        self.answers.set()

    def test_writable(self) -> None:
        self._reach()
        self.pulses += 1

    def row(self, row: str) -> Callable[[], str]:
        def write() -> str:
            self._reach()
            self.rows.append(row)
            return row

        return write

    def _reach(self) -> None:
        assert self.answers.wait(10)
        if self.away:
            raise RecordError(self.away)


@pytest.fixture
def log() -> Log:
    return Log()


@pytest.fixture
def writer(log: Log) -> Iterator[RecordWriter]:
    writer = RecordWriter(log.test_writable)
    yield writer
    log.answers.set()
    writer.close()


def written(writer: RecordWriter) -> None:
    """Wait until the worker is idle."""
    done = threading.Event()
    writer.run_in_background(done.set)
    assert done.wait(10)


def ticks(writer: RecordWriter, from_s: float, to_s: float, *, watched: bool = False) -> None:
    """Tick ten times a second between two times (s); wait for the worker after each tick."""
    for tenth in range(round(from_s * 10), round(to_s * 10)):
        writer.tick(tenth / 10, watched)
        written(writer)


def test_request_is_reported_when_written(writer: RecordWriter, log: Log) -> None:
    called = threading.Event()
    writer.on_done = called.set
    assert writer.ask(log.row("a"), 0.0).result(10) == "a"
    assert called.wait(10)


def test_request_without_database_is_refused_and_dropped(writer: RecordWriter, log: Log) -> None:
    log.away = "the disk is full"
    asked = writer.ask(log.row("a"), 0.0)
    with pytest.raises(RecordError, match="the disk is full"):
        asked.result(10)
    log.away = None
    ticks(writer, 0.0, 2.0)
    assert log.rows == []
    assert writer.ask(log.row("b"), 2.0).result(10) == "b"


def test_kept_events_are_written_in_order_later(writer: RecordWriter, log: Log) -> None:
    log.away = "locked"
    begun = writer.keep(log.row("begun"), 0.0)
    writer.keep(lambda: log.row(f"end of {begun.result()}")(), 0.1, of=begun)
    refused = writer.ask(log.row("asked"), 0.2)
    ticks(writer, 0.2, 3.0)
    assert refused.exception() is not None
    log.away = None
    ticks(writer, 3.0, 4.0)
    assert log.rows == ["begun", "end of begun"]
    assert writer.trouble is None


def test_request_is_written_after_earlier_events(writer: RecordWriter, log: Log) -> None:
    log.away = "locked"
    writer.keep(log.row("happened"), 0.0)
    written(writer)
    log.away = None
    writer.ask(log.row("asked"), 0.1).result(10)
    assert log.rows == ["happened", "asked"]


def test_refused_request_has_no_later_records(writer: RecordWriter, log: Log) -> None:
    log.away = "locked"
    start = writer.ask(log.row("start"), 0.0)
    end = writer.keep(log.row("end"), 0.1, of=start)
    written(writer)
    log.away = None
    ticks(writer, 0.2, 2.0)
    assert log.rows == []
    assert end.exception() is not None


@pytest.mark.parametrize("error", [BadRecord("no JSON"), KeyError("a mistake of ours")])
def test_bad_record_is_logged_and_does_not_block_others(
    writer: RecordWriter, log: Log, caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    def bad() -> None:
        raise error

    with caplog.at_level(logging.ERROR):
        assert writer.keep(bad, 0.0).exception(10) is error
    assert caplog.records
    assert writer.ask(log.row("next"), 0.1).result(10) == "next"


def test_writability_is_tested_twice_a_second_while_watched(writer: RecordWriter, log: Log) -> None:
    ticks(writer, 0.0, 2.0)
    assert log.pulses == 0
    ticks(writer, 2.0, 4.0, watched=True)
    assert log.pulses == 4


def test_records_are_overdue_after_two_seconds(writer: RecordWriter, log: Log) -> None:
    ticks(writer, 0.0, 1.0, watched=True)
    log.away = "locked"
    ticks(writer, 1.0, 3.0, watched=True)
    assert writer.overdue(3.0) is None
    ticks(writer, 3.0, 3.5, watched=True)
    assert writer.overdue(3.5) == "locked"
    log.away = None
    ticks(writer, 3.5, 4.5, watched=True)
    assert writer.overdue(4.5) is None


def test_one_failure_among_successes_is_not_overdue(writer: RecordWriter, log: Log) -> None:
    for second in range(6):
        log.away = "locked" if second % 2 else None
        ticks(writer, second, second + 1, watched=True)
        assert writer.overdue(second + 1) is None


def test_silent_database_is_overdue_and_is_asked_once(writer: RecordWriter, log: Log) -> None:
    log.answers.clear()
    for tenth in range(25):
        writer.tick(tenth / 10, watched=True)
    why = writer.overdue(2.5)
    assert why is not None and "no answer" in why
    log.answers.set()
    written(writer)
    assert log.pulses == 1
    assert writer.overdue(2.5) is None


def test_after_a_failure_the_database_is_tested_until_it_works(writer: RecordWriter, log: Log) -> None:
    log.away = "locked"
    writer.ask(log.row("a"), 0.0)
    written(writer)
    assert writer.trouble is not None
    log.away = None
    ticks(writer, 0.1, 0.2)
    assert writer.trouble is None


def test_records_lost_at_the_end_are_logged(log: Log, caplog: pytest.LogCaptureFixture) -> None:
    writer = RecordWriter(log.test_writable)
    log.away = "locked"
    writer.keep(log.row("a"), 0.0)
    with caplog.at_level(logging.ERROR):
        writer.close()
    assert "before the end: 1" in caplog.text
