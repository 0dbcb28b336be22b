"""A process ends in time, at any moment of a signal."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.processes import REPOSITORY

SOON_S = 5.0
BEGIN = """import sys, time
from robots.shared.processes.shutdown import end_event
end = end_event({}); print(flush=True)
"""
NO_LIFE_LINE, LIFE_LINE, IMPATIENT = "None, 60", "0, 60", "None, 0.2"
ALWAYS_ABOUT_TO_WAIT = "while not end.wait(0.0): pass"
WAITS = "end.wait()"
HANGS = "while True: time.sleep(1)"
Process = subprocess.Popen[bytes]


@pytest.fixture
def begin() -> Iterator[object]:
    """`begin(how, then)`: start a process that can be asked to end."""
    with ExitStack() as ending:

        def begin(how: str, then: str) -> Process:
            process = ending.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", BEGIN.format(how) + then],
                    cwd=REPOSITORY,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                )
            )
            ending.callback(process.kill)
            assert process.stdout
            process.stdout.readline()
            return process

        yield begin


def test_a_signal_wakes_a_thread_about_to_wait(begin) -> None:
    # If a signal handler in the main thread set the event, most of these processes would hang.
    for process in [begin(NO_LIFE_LINE, ALWAYS_ABOUT_TO_WAIT) for _ in range(6)]:
        process.terminate()
        assert process.wait(SOON_S) == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_it(number: signal.Signals, begin) -> None:
    process = begin(LIFE_LINE, WAITS)
    process.send_signal(number)
    assert process.wait(SOON_S) == 0


def test_the_end_of_its_life_line_ends_it_and_words_on_it_do_not(begin) -> None:
    process = begin(LIFE_LINE, "print(end.wait(0.3), flush=True); end.wait()")
    process.stdin.write(b"still here\n")
    process.stdin.flush()
    assert process.stdout.readline() == b"False\n"
    process.stdin.close()
    assert process.wait(SOON_S) == 0


def test_a_hanging_process_is_killed_after_its_time(begin) -> None:
    process = begin(IMPATIENT, HANGS)
    process.terminate()
    began_s = time.monotonic()
    assert process.wait(SOON_S) == 1
    assert time.monotonic() - began_s < 2.0
