"""If nothing can be recorded for two seconds, motion and tasks end (not speech), and no task begins later."""

import pytest

from robots.shared import wire
from robots.shared.geometry.poses import STILL
from tests.bridge.support import ORDERS, ObedientBench

NOTE = wire.Publish(1, "/notes", "std_msgs/String", {"data": "hello"}, 5.0)


@pytest.fixture
def bench():
    return ObedientBench()


def begun(bench, order):
    assert bench.order(order) is None
    bench.recorded()
    bench.core.tick(bench.now_s)


def passes(bench, seconds):
    """Let time pass; the robot reports its motion."""
    for _ in range(round(seconds / 0.1)):
        goals = [goal_id for goal_id, _ in bench.base.played]
        bench.core.tasks.motions.running("/play_motion", goals, bench.now_s)
        bench.pass_time(0.1)


def verdict(bench):
    return bench.core.state(bench.now_s, []).verdict


def test_tasks_end_after_two_seconds_without_records(bench):
    begun(bench, NOTE)
    begun(bench, ORDERS["motion"])
    [(goal_id, _)] = bench.base.played
    bench.sink.fails = "disk full"
    passes(bench, 1.9)
    assert (bench.base.cancelled_goals, bench.publisher.stopped) == ([], [])
    passes(bench, 0.8)
    assert (set(bench.base.cancelled_goals), bench.publisher.stopped) == ({goal_id}, ["/notes"])
    assert bench.core.state(bench.now_s, []).publishing == []
    blocked = verdict(bench)
    assert (blocked.code, blocked.text) == (
        "not_recorded",
        "The robot stands still because its actions cannot be recorded (disk full)."
        " Ended: the motion “wave”, publishing on /notes.",
    )
    bench.core.tasks.motions.ended(goal_id, "cancelled", "", bench.now_s)
    assert bench.core.state(bench.now_s, []).motion_ended.text == blocked.text
    bench.sink.fails = None
    bench.pass_time(0.6)
    ends = [(kind, end.outcome) for kind, end in bench.sink.records if kind.endswith(".end")]
    assert ends == [("publish.end", "not_recorded"), ("motion.end", "not_recorded")]
    assert verdict(bench).code == "idle"


@pytest.mark.parametrize("what", ORDERS)
def test_no_task_begins_without_records_for_the_same_reason(bench, what):
    begun(bench, NOTE)
    bench.sink.fails = "disk full"
    bench.pass_time(2.7)
    refusal = bench.order(ORDERS[what])
    assert (refusal.code, refusal.text) == ("not_recorded", verdict(bench).text)
    bench.sink.fails = None
    bench.pass_time(0.6)
    begun(bench, ORDERS[what])


@pytest.mark.parametrize("what", ORDERS)
def test_task_waiting_for_a_hanging_database_is_refused(bench, what):
    bench.sink.open.clear()
    answers = bench.ask(ORDERS[what])
    bench.pass_time(1.9)
    assert answers == []
    bench.pass_time(0.3)
    assert [refusal.code for refusal in answers] == ["not_recorded"]
    bench.sink.open.set()
    bench.recorded()
    bench.pass_time(0.05)  # this tick comes before the loop gets the written record
    bench.obeys()
    assert bench.begun == []
    kinds = bench.sink.kinds
    assert len(kinds) == 2
    assert bench.sink.records[1][1].outcome == "not_recorded"


def test_a_text_is_said_to_its_end(bench):
    begun(bench, wire.Say(1, "Hello", "en-GB"))
    [(goal_id, _)] = bench.base.said
    bench.sink.fails = "disk full"
    bench.order(wire.Play(1, "wave"))  # by this request, the bridge detects that nothing can be recorded
    for _ in range(28):
        bench.core.tasks.speech.running("/tts", {goal_id: "speaking"}, bench.now_s)
        bench.pass_time(0.1)
    assert verdict(bench).code == "not_recorded"
    assert bench.base.cancelled_goals == []
    assert bench.order(wire.Say(1, "More", "en-GB")).code == "not_recorded"


def test_stick_out_during_the_failure_needs_neutral(bench):
    begun(bench, NOTE)
    bench.sink.fails = "disk full"
    bench.pass_time(2.7)
    assert bench.stick(0.5).code == "not_recorded"
    bench.sink.fails = None
    bench.pass_time(0.2)
    assert bench.stick(0.5).code == "neutral_needed"
    assert bench.last == STILL
    bench.stick(0.0)
    bench.driving()
