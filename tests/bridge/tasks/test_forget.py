"""The gate's memory is forgotten on the holder's recorded request, while the robot stands still."""

from __future__ import annotations

import pytest

from robots.shared import wire
from robots.shared.geometry.poses import Velocity
from tests.bridge.support import Bench, Outcome, codes, settled


@pytest.fixture
def bench():
    return Bench().online().granted()


def ask(bench, fence=1, link=1):
    """Send the request; return its answers so far."""
    return bench.ask(wire.Forget(fence), link)


def test_memory_is_forgotten_when_the_request_is_recorded(bench):
    bench.sink.open.clear()
    answers = ask(bench)
    bench.core.tick(bench.now_s)
    assert (bench.gate.forgot, answers) == ([], [])
    bench.sink.open.set()
    settled(bench)
    assert (bench.gate.forgot, answers) == ([False], [None]), "the robot did not begin anew"
    assert bench.sink.records == [("memory.forget", {}), ("memory.forget", Outcome("sent"))]


def test_the_stick_need_not_return_to_the_middle(bench):
    ask(bench)
    settled(bench)
    bench.driving()


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.driving(), "base_moving"),
        (lambda bench: bench.odometry(Velocity(0.1, 0.0, 0.0)), "base_moving"),
        (lambda bench: setattr(bench, "now_s", bench.now_s + 0.3), "base_moving"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (
            lambda bench: bench.core.tasks.motions.running("/play_motion", ["other"], bench.now_s),
            "motion_running",
        ),
        (lambda bench: setattr(bench.base, "listeners", 0), "robot_offline"),
    ],
)
def test_forbidden_request_is_refused_and_not_recorded(bench, spoil, code):
    spoil(bench)
    [refusal] = ask(bench)
    assert refusal.code == code and refusal.text
    settled(bench)
    assert bench.gate.forgot == []
    assert "memory.forget" not in bench.sink.kinds


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.odometry(Velocity(0.1, 0.0, 0.0)), "base_moving"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "halted"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "halted"),
        (lambda bench: setattr(bench.sink, "fails", "disk full"), "not_recorded"),
    ],
)
def test_event_before_the_record_prevents_forgetting(bench, spoil, code):
    bench.sink.open.clear()
    answers = ask(bench)
    spoil(bench)
    bench.sink.open.set()
    settled(bench)
    assert (bench.gate.forgot, codes(answers)) == ([], [code])


def test_only_the_holder_is_obeyed(bench):
    assert codes(ask(bench, fence=2)) == ["unknown_fence"]
    assert len(codes(ask(bench, link=2))) == 1
    settled(bench)
    assert bench.gate.forgot == []
