"""Odometry of a robot at rest: the newest message stands for those that wait before it, but for nothing else."""

from __future__ import annotations

import pytest

from robots.bridge.robot.incoming.standing import Standing


class Box:
    """Messages that wait; `taken` returns the stamps of those that are handled."""

    def __init__(self) -> None:
        self.standing = Standing()
        self.waiting: list[tuple[int, float]] = []

    def add(self, *stamps_s: float, run: int = 0, rests: bool = True) -> None:
        for stamp_s in stamps_s:
            self.waiting.append((self.standing.next(), stamp_s))
            self.standing.waits(stamp_s, run, rests=rests)

    def taken(self) -> list[float]:
        found = []
        for number, stamp_s in self.waiting:
            if not self.standing.is_shown_by_newest(number):
                self.standing.taken(stamp_s)
                found.append(stamp_s)
        self.waiting.clear()
        return found


@pytest.fixture
def box():
    box = Box()
    box.add(1.0)
    assert box.taken() == [1.0]
    return box


def test_the_newest_message_is_taken_for_all(box):
    box.add(1.02, 1.04, 1.06)
    assert box.taken() == [1.06]
    box.add(1.08)
    assert box.taken() == [1.08]


def test_a_message_of_a_moving_robot_is_not_left_out(box):
    box.add(1.02)
    box.add(1.04, rests=False)
    box.add(1.06, 1.08)
    assert box.taken() == [1.02, 1.04, 1.08]


def test_nothing_is_left_out_for_a_newest_message_of_a_moving_robot(box):
    box.add(1.02, 1.04)
    box.add(1.06, rests=False)
    assert box.taken() == [1.02, 1.04, 1.06]


def test_after_a_silence_all_are_taken(box):
    box.add(1.02, 1.04, 1.3)
    assert box.taken() == [1.02, 1.04, 1.3]


def test_another_publisher_stands_for_nothing(box):
    box.add(1.02)
    box.add(1.04, run=1)
    assert box.taken() == [1.02, 1.04]


def test_a_message_that_does_not_wait_yet_stands_for_nothing(box):
    box.add(1.02)
    box.standing.next()
    assert box.taken() == [1.02]
