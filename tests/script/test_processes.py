"""Children end with us, and are started so that they do not end before."""

from __future__ import annotations

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor

import pytest

from script.stack.processes import TIED_TO_US, Child
from tests.script.support import ENDED_S


def test_a_child_runs_its_command_as_it_is() -> None:
    child = Child("speller", ["/usr/bin/test", "a b", "=", "a b"], env={})
    assert child.wait(ENDED_S)
    assert child.fate() == "ended with status 0"


def test_a_child_whose_parent_is_gone_already_does_not_begin() -> None:
    somebody_else = str(os.getppid())
    assert subprocess.run([*TIED_TO_US, somebody_else, "/bin/true"]).returncode == 1


def test_a_thread_starts_no_child_for_it_would_end_with_the_thread() -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(RuntimeError, match="from the main thread"):
        pool.submit(Child, "sleeper", ["/bin/sleep", "9"], env={}).result()
