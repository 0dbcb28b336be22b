"""The comparison of the log with the robot finds requests that were recorded late or never."""

from __future__ import annotations

import pytest

from benchmarks.soak.reconciliation import Entry, Received, unfinished, unrecorded

SAID = Received("speech.start", 10.0, "Hello.", "goal-1")
NOTE = Received("publish.start", 11.0, "a note")
PLAYED = Received("motion.start", 12.0, "open", "goal-2")
MOVED = Received("drive.start", 20.0, "/key_vel")


def entry(number: int, at_s: float, kind: str, of: int | None = None, **details: str) -> Entry:
    return Entry(number, at_s, kind, of, "", details)


LOG = [
    entry(1, 9.9, "speech.start", text="Hello."),
    entry(2, 10.9, "publish.start", fields='{"data":"a note"}'),
    entry(3, 11.9, "motion.start", motion="open"),
    entry(4, 19.9, "drive.start"),
    entry(5, 21.0, "drive.end", of=4),
]
RECEIVED = [SAID, NOTE, PLAYED, MOVED]


def test_requests_recorded_before_their_effect_are_fine() -> None:
    assert unrecorded(RECEIVED, LOG) == []


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_a_record_that_is_missing_is_found(number: int) -> None:
    assert unrecorded(RECEIVED, [found for found in LOG if found.id != number])


@pytest.mark.parametrize(
    "late",
    [
        entry(1, 10.1, "speech.start", text="Hello."),
        entry(2, 11.1, "publish.start", fields='{"data":"a note"}'),
        entry(3, 12.1, "motion.start", motion="open"),
        entry(4, 20.1, "drive.start"),
    ],
)
def test_a_record_that_was_made_afterwards_is_found(late: Entry) -> None:
    assert unrecorded(RECEIVED, [late if found.id == late.id else found for found in LOG])


def test_the_same_asked_for_twice_needs_two_records() -> None:
    again = Received("motion.start", 13.0, "open", "goal-3")
    assert unrecorded([*RECEIVED, again], LOG)
    assert unrecorded([*RECEIVED, again], [*LOG, entry(6, 12.9, "motion.start", motion="open")]) == []


def test_a_goal_that_only_the_robot_speaks_of_needs_a_record_too() -> None:
    assert unrecorded([*RECEIVED, Received("speech.start", 10.0, "", "goal-4")], LOG)


@pytest.mark.parametrize("at_s", [19.8, 21.5])
def test_a_velocity_before_or_after_the_drive_is_found(at_s: float) -> None:
    assert unrecorded([Received("drive.start", at_s, "/key_vel")], LOG)


def test_a_velocity_on_an_unchosen_topic_is_found() -> None:
    elsewhere = Received("drive.start", 20.0, "/phone_vel")
    assert unrecorded([elsewhere], LOG)
    assert unrecorded([elsewhere], [*LOG, entry(6, 19.0, "topic.choose", to="/phone_vel")]) == []
    assert unrecorded([elsewhere], [*LOG, entry(6, 19.0, "topic.choose", of=5)])


def test_a_request_without_outcome_is_found() -> None:
    assert len(unfinished(LOG, before_s=30.0)) == 3
    ends = [
        entry(6, 13.0, "speech.end", 1),
        entry(7, 13.0, "publish.end", 2),
        entry(8, 13.0, "motion.end", 3),
    ]
    assert unfinished([*LOG, *ends], before_s=30.0) == []
    assert unfinished(LOG, before_s=5.0) == []
