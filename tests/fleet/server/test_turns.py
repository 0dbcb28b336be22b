"""The event loop reads one piece of a stranger's data per turn."""

from collections import deque

import pytest

from fleet.server.turns import Turns


@pytest.fixture
def loop():
    """An event loop that the test steps turn by turn."""
    return deque()


@pytest.fixture
def turn(loop):
    return lambda: [loop.popleft()() for _ in range(len(loop))]


def test_each_piece_has_a_turn_of_its_own_in_order(loop, turn):
    turns, done = Turns(loop.append), []
    for number in range(3):
        turns.take(lambda number=number: done.append(number))
    for heard in ([0], [0, 1], [0, 1, 2], [0, 1, 2]):
        turn()
        assert done == heard
    turns.take(lambda: done.append("later"))
    turn()
    assert done[-1] == "later"


def test_a_piece_that_fails_does_not_end_the_turns(loop, turn):
    turns, done = Turns(loop.append), []
    turns.take(lambda: 1 / 0)
    turns.take(lambda: done.append("next"))
    with pytest.raises(ZeroDivisionError):
        turn()
    turn()
    assert done == ["next"]
