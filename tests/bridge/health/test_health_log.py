"""Each change of the robot's health is recorded once; few, if a part changes often or the robot is away."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robots.bridge.health.diagnostics import SILENT_S, Diagnostics, Status
from robots.bridge.health.health_log import (
    AT_ONCE,
    PART_BURST,
    PART_GAP_S,
    ROBOT_BURST,
    SETTLED_S,
    HealthLog,
)
from tests.bridge.support import Bench

OK, WARN, ERROR, STALE = range(4)
WELL, BROKEN = Status("Speakers", OK, "OK"), Status("Speakers", ERROR, "Amplifier does not answer")


class Robot:
    """A robot whose nodes report once a second."""

    def __init__(self) -> None:
        self.bench = Bench()
        self.now_s = 0.0
        self.restart_bridge()

    def restart_bridge(self) -> None:
        self.diagnostics = Diagnostics()
        self.log = HealthLog(self.diagnostics, self.bench.records)

    def reports(self, *parts: Status, seconds: float = 3.0, online: bool = True) -> None:
        for _ in range(int(seconds)):
            self.now_s += 1.0
            self.diagnostics.observe(parts, self.now_s)
            self.log.tick(online, self.now_s)
            self.bench.recorded()

    @property
    def changes(self) -> list[tuple[str, str, str, str]]:
        """Return kind, part and levels of the records."""
        return [(kind, what["part"], what["from"], what["to"]) for kind, what in self.bench.sink.records]


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot()
    yield robot
    robot.bench.close()


def test_worse_and_better_are_recorded_once_with_words_and_since_when(robot):
    robot.reports(WELL)
    assert robot.changes == []
    robot.reports(BROKEN)
    robot.reports(Status("Speakers", WARN, "quiet"))
    robot.reports(WELL)
    assert robot.bench.sink.records == [
        (kind, {"part": "Speakers", "from": was, "to": to, "since_s": 0.0, "text": f"Speakers: {words}"})
        for kind, was, to, words in (
            ("health.worse", "ok", "error", "Amplifier does not answer"),
            ("health.better", "error", "warning", "quiet"),
            ("health.better", "warning", "ok", "OK"),
        )
    ]


def test_a_part_that_is_ill_from_the_beginning_was_nothing_before(robot):
    robot.reports(BROKEN)
    assert robot.changes == [("health.worse", "Speakers", None, "error")]


def test_silence_is_recorded_with_the_time_when_it_was_last_heard(robot):
    robot.reports(WELL, seconds=SETTLED_S)
    robot.reports(seconds=SILENT_S + 1.0)
    [(kind, change)] = robot.bench.sink.records
    assert (kind, change["to"], change["text"]) == (
        "health.worse",
        "silent",
        "Speakers: has stopped reporting",
    )
    assert change["since_s"] > SILENT_S


def test_silence_after_an_error_is_no_improvement(robot):
    robot.reports(WELL)
    robot.reports(BROKEN, seconds=SETTLED_S)
    robot.reports(seconds=SILENT_S + 1.0)
    robot.reports(WELL)
    assert [change[::3] for change in robot.changes] == [
        ("health.worse", "error"),
        ("health.worse", "silent"),
        ("health.better", "ok"),
    ]


def test_a_part_that_flaps_is_recorded_seldom_with_how_often(robot):
    for _ in range(int(PART_GAP_S)):
        robot.reports(WELL, seconds=1.0)
        robot.reports(BROKEN, seconds=1.0)
    assert PART_BURST < len(robot.changes) <= PART_BURST + 2
    assert robot.bench.sink.records[-1][1]["times"] > 500
    robot.reports(WELL, seconds=2 * PART_GAP_S)
    assert robot.changes[-1] == ("health.better", "Speakers", "error", "ok")


def test_a_robot_whose_parts_all_flap_is_recorded_seldom(robot):
    for _ in range(30):
        robot.reports(*(BROKEN._replace(name=f"part {number}") for number in range(100)), seconds=1.0)
        robot.reports(*(WELL._replace(name=f"part {number}") for number in range(100)), seconds=1.0)
    assert ROBOT_BURST <= len(robot.changes) <= ROBOT_BURST + 1


def test_nothing_is_recorded_of_a_robot_that_is_switched_off_and_on(robot):
    robot.reports(WELL, seconds=SETTLED_S)
    robot.reports(seconds=2 * SILENT_S, online=False)
    robot.reports(seconds=SILENT_S)  # the base's driver runs, nodes do not report yet
    robot.reports(WELL, seconds=SETTLED_S + 2.0)
    assert robot.changes == []
    robot.reports(seconds=2 * SILENT_S, online=False)
    robot.reports(seconds=SETTLED_S + 2.0)
    assert robot.changes == [("health.worse", "Speakers", "ok", "silent")]


def test_the_error_that_takes_the_base_away_is_recorded(robot):
    robot.reports(WELL, seconds=SETTLED_S)
    robot.reports(BROKEN, online=False)  # this error also ended the odometry
    assert robot.changes == [("health.worse", "Speakers", "ok", "error")]
    robot.reports(BROKEN, seconds=2 * SETTLED_S, online=False)
    robot.reports(WELL, online=False)  # the robot is being repaired, or starts
    assert len(robot.changes) == 1
    robot.reports(WELL)
    assert robot.changes[1:] == [("health.better", "Speakers", "error", "ok")]


def test_many_parts_that_fall_silent_at_once_are_recorded_in_turn(robot):
    parts = [WELL._replace(name=f"part {number}") for number in range(10)]
    robot.reports(*parts, seconds=SETTLED_S)
    robot.reports(seconds=SILENT_S + 1.0)
    assert 0 < len(robot.changes) <= 2 * AT_ONCE
    robot.reports(seconds=10.0)
    assert sorted(part for _, part, _, _ in robot.changes) == sorted(part.name for part in parts)


def test_silence_hides_no_error_that_waits_for_its_record(robot):
    robot.reports(WELL, seconds=SETTLED_S)
    for _ in range(PART_BURST // 2):
        robot.reports(BROKEN)
        robot.reports(WELL)
    robot.reports(BROKEN)
    robot.reports(seconds=SILENT_S + 2 * PART_GAP_S)
    told = [(change["to"], change["text"]) for _, change in robot.bench.sink.records[PART_BURST:]]
    assert told == [
        ("error", "Speakers: Amplifier does not answer"),
        ("silent", "Speakers: has stopped reporting"),
    ]


def test_a_new_bridge_goes_on_from_what_is_on_record(robot):
    robot.bench.sink.ill = {"Speakers": "error"}
    robot.reports(BROKEN)
    assert robot.changes == []
    robot.restart_bridge()
    robot.reports(WELL, seconds=2 * PART_GAP_S)  # in this time, the part's budget is forgotten
    assert robot.changes == [("health.better", "Speakers", "error", "ok")]


def test_records_are_read_again_while_the_database_is_away(robot):
    robot.bench.sink.ill = {"Speakers": "error"}
    robot.bench.sink.fails = "the disk is full"
    robot.reports(WELL)
    robot.bench.sink.fails = None
    robot.reports(WELL, seconds=5.0)
    assert robot.changes == [("health.better", "Speakers", "error", "ok")]
