"""A process's words about refused data, and the memory that a robot's network may take."""

from __future__ import annotations

import os
import subprocess
import sys

from robots.bridge.robot.board import MOST_BARRED, MOST_SHOWN, SHOWN_S, Board
from robots.shared import texts
from tests.processes import REPOSITORY

LONG = "n" * 1_000_000


def test_refusals_are_shown_for_a_while_in_bounds():
    board = Board()
    for number in range(100):
        board.complain(f"/topic_{number}", f"{number} {LONG}", now_s=0.0)
    shown = board.texts(now_s=1.0)
    assert len(shown) == MOST_SHOWN
    assert shown[0].startswith("99 ")
    assert max(map(len, shown)) <= texts.SENTENCE
    assert board.texts(now_s=SHOWN_S + 1.0) == []


def test_a_cut_off_publisher_is_tried_again_after_its_time():
    board = Board()
    board.bar("/scan", "http://x/", until_s=10.0)
    assert board.barred("/scan", "http://x/", now_s=9.0)
    assert board.released(9.0) == set()
    assert board.released(10.0) == {"/scan"}
    assert not board.barred("/scan", "http://x/", now_s=10.0)


def test_a_publisher_that_a_full_board_drops_is_tried_again():
    board = Board()
    board.bar("/scan", "http://x/", until_s=10.0)
    for number in range(MOST_BARRED):
        board.bar("/other", f"http://{number}/", until_s=20.0)
    assert board.released(9.0) == set()
    assert board.released(10.0) == {"/scan"}
    assert board.released(11.0) == set()


GREEDY = """
import sys
from robots.shared.processes.memory import limit_memory
limit_memory(200 * 1024 * 1024)
kept = []
try:
    while True:
        kept.append(bytearray(10_000_000))
except MemoryError:
    sys.exit(f"full at {len(kept)}")
"""


def test_a_process_gets_no_memory_beyond_its_ceiling():
    ended = subprocess.run(
        [sys.executable, "-c", GREEDY], cwd=REPOSITORY, env=dict(os.environ), capture_output=True, text=True
    )
    assert ended.returncode == 1
    assert 5 < int(ended.stderr.removeprefix("full at ")) < 25


IGNORING = """
import signal
from robots.shared.processes.memory import end_without_memory
signal.signal(signal.SIGTERM, signal.SIG_IGN)
end_without_memory()
print("goes on")
"""


def test_a_process_that_ignores_the_end_signal_ends_without_memory():
    ended = subprocess.run(
        [sys.executable, "-c", IGNORING], cwd=REPOSITORY, env=dict(os.environ), capture_output=True, text=True
    )
    assert (ended.returncode, ended.stdout) == (1, "")
