"""The event loop reads one piece of a stranger's data per turn."""

from collections import deque

import pytest

from fleet.server.work_queue import WorkQueue


@pytest.fixture
def loop():
    """An event loop that the test steps turn by turn."""
    return deque()


@pytest.fixture
def turn(loop):
    return lambda: [loop.popleft()() for _ in range(len(loop))]


def test_each_piece_has_a_turn_of_its_own_in_order(loop, turn):
    work, done = WorkQueue(loop.append), []
    for number in range(3):
        work.add(lambda number=number: done.append(number))
    for heard in ([0], [0, 1], [0, 1, 2], [0, 1, 2]):
        turn()
        assert done == heard
    work.add(lambda: done.append("later"))
    turn()
    assert done[-1] == "later"


def test_a_piece_that_fails_does_not_end_the_turns(loop, turn):
    work, done = WorkQueue(loop.append), []
    work.add(lambda: 1 / 0)
    work.add(lambda: done.append("next"))
    with pytest.raises(ZeroDivisionError):
        turn()
    turn()
    assert done == ["next"]
