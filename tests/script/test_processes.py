"""Child processes end when their parent ends, not earlier."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from script.stack.processes import ENDING_SIGNALS, TIED_TO_US, Child
from tests.script.support import ENDED_S


def test_a_child_runs_its_command_as_it_is() -> None:
    child = Child("speller", ["/usr/bin/test", "a b", "=", "a b"], env={})
    assert child.wait(ENDED_S)
    assert child.fate() == "ended with status 0"


def test_a_child_that_crashes_says_where(tmp_path: Path) -> None:
    crash = "import ctypes\ndef here(): ctypes.string_at(0)\nhere()"
    child = Child("crasher", [sys.executable, "-c", crash], env={}, log=tmp_path / "log")
    assert child.wait(ENDED_S)
    assert child.fate() == "was ended by SIGSEGV"
    assert "in here" in child.last_lines()


WAITING = """
import os, sys
from script.stack.processes import Ended, ended_by_signals
try:
    with ended_by_signals():
        for number in sys.argv[1:]:
            os.kill(os.getpid(), int(number))
except Ended as ended:
    os.kill(os.getpid(), int(number))
    print(ended, "undisturbed")
"""


@pytest.mark.parametrize("number", ENDING_SIGNALS)
def test_ctrl_c_and_hang_up_end_a_command_after_clean_up(
    number: signal.Signals,
) -> None:
    command = [sys.executable, "-c", WAITING, str(number.value)]
    assert (
        subprocess.run(command, capture_output=True, text=True, check=True).stdout
        == f"{number.name} undisturbed\n"
    )


def test_a_child_whose_parent_is_gone_already_does_not_begin() -> None:
    somebody_else = str(os.getppid())
    assert subprocess.run([*TIED_TO_US, somebody_else, "/bin/true"]).returncode == 1


def test_a_thread_starts_no_child() -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(RuntimeError, match="from the main thread"):
        pool.submit(Child, "sleeper", ["/bin/sleep", "9"], env={}).result()
