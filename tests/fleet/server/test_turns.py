"""The event loop reads one piece of a client's data per turn, and nobody waits long behind one who sends much."""

import asyncio
from collections import deque
from functools import partial

import pytest

from fleet.server.turns import FairQueue, Turns, WorkQueue

STRANGER, OTHER = ("others", "10.0.0.1"), ("others", "10.0.0.2")


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
        work.add(partial(done.append, number), STRANGER)
    for heard in ([0], [0, 1], [0, 1, 2], [0, 1, 2]):
        turn()
        assert done == heard
    work.add(partial(done.append, "later"), STRANGER)
    turn()
    assert done[-1] == "later"


def test_a_piece_that_fails_does_not_end_the_turns(loop, turn):
    work, done = WorkQueue(loop.append), []
    work.add(lambda: 1 / 0, STRANGER)
    work.add(partial(done.append, "next"), STRANGER)
    with pytest.raises(ZeroDivisionError):
        turn()
    turn()
    assert done == ["next"]


def test_a_piece_waits_for_few_of_those_who_send_much(loop, turn):
    """A stranger and a person who may stop robots send many pieces; others wait for two turns, or three."""
    work, done = WorkQueue(loop.append), []
    for _ in range(50):
        work.add(partial(done.append, "stranger"), STRANGER)
        work.add(partial(done.append, "colleague"), ("people", "colleague"))
    turn()
    work.add(partial(done.append, "other"), OTHER)
    work.add(partial(done.append, "presser"), ("people", "presser"))
    for _ in range(7):
        turn()
    assert done.index("presser") <= 4
    assert done.index("other") <= 4
    while loop:
        turn()
    assert len(done) == 102


def test_a_queue_is_fair_and_keeps_the_order_of_each():
    queue = FairQueue()
    for item in ("ax1", "ax2", "ax3", "ay1", "bx1", "cx1", "bx2"):
        queue.add((item[0], item[1]), item)
    found = [queue.pop() for _ in range(len(queue))]
    assert found == ["ax1", "bx1", "cx1", "ay1", "bx2", "ax2", "ax3"]
    assert not queue


async def test_turns_are_taken_few_at_once_and_given_back():
    turns, running, most = Turns(2), 0, 0

    async def work(key):
        nonlocal running, most
        async with turns.turn((key,)):
            running += 1
            most = max(most, running)
            try:
                await asyncio.sleep(0)
            finally:
                running -= 1

    tasks = [asyncio.ensure_future(work(key)) for key in "aaabbb"]
    await asyncio.sleep(0)
    tasks[2].cancel()  # it waits
    tasks[0].cancel()  # it has its turn
    await asyncio.gather(*tasks, return_exceptions=True)
    assert most == 2
    await asyncio.wait_for(work("later"), 5)
    assert turns._free == 2
