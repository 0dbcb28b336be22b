"""The supervisor restarts programs at a limited rate and ends them in order. The programs are real processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import psutil
import pytest

from robots.registry.models import BridgeStatus
from robots.shared.processes import last_words
from robots.shared.processes.one_supervisor import AlreadySupervised, only_instance, supervised
from robots.shared.processes.restarts import RestartBudget
from robots.shared.processes.shutdown import EXIT_NAME_LOST, EXIT_NOT_JOINED
from robots.shared.sentences import Sentence, say
from robots.supervisor.fleet_supervisor import eager
from robots.supervisor.process_keeper import (
    KILL_S,
    STEADY_S,
    TERMINATE_S,
    Keeper,
    Program,
)
from tests.processes import until
from tests.robots.support import STUBBORN, FakePrograms

State = BridgeStatus.State


def test_waits_grow_and_a_spent_budget_rests() -> None:
    budget = RestartBudget(first_s=0.5, longest_s=4.0, falls=5, window_s=60.0, rest_s=60.0)
    assert [budget.wait_s(at) for at in (0, 1, 3, 6, 11)] == [0.5, 1.0, 2.0, 4.0, 4.0]
    assert budget.wait_s(16) == 60.0


def test_a_program_that_falls_rarely_is_back_soon_each_time() -> None:
    budget = RestartBudget(first_s=0.5, window_s=60.0)
    assert [budget.wait_s(at) for at in (0, 100, 200, 300, 400, 500, 600, 700)] == [0.5] * 8


def test_a_failing_watchdog_leaves_the_processor_to_others() -> None:
    budget, now_s, starts = eager(), 0.0, 0
    assert eager().wait_s(0.0) <= 0.1
    while now_s < 600.0:
        now_s, starts = now_s + budget.wait_s(now_s), starts + 1
    assert starts <= 80, "half a second of a processor each"


class Kept:
    """A process keeper with its reports and a fake clock."""

    def __init__(self, programs: FakePrograms) -> None:
        self.programs = programs
        self.reports: list[tuple[State, str, int | None]] = []
        self.keeper = Keeper("Fake", lambda *report: self.reports.append(report))
        self.now_s = 100.0

    def want(self, name: str, digest: str = "1") -> None:
        environment = {**os.environ, "FAKE_LOG": str(self.programs.log)}
        self.keeper.want(Program(self.programs.arguments(name), environment, digest))

    def step(self, after_s: float = 0.0) -> None:
        self.now_s += after_s
        self.keeper.step(self.now_s)

    def states(self) -> list[State]:
        return [state for state, _, _ in self.reports]

    def step_until_started(self, times: int) -> None:
        self.step()
        until(lambda: len(self.programs.pids("fake")) == times, f"start number {times}")

    def step_until_reported(self, count: int) -> None:
        until(lambda: (self.step(), len(self.reports) >= count)[1], f"report number {count}")

    def close(self) -> None:
        self.keeper.want(None)
        until(lambda: (self.step(1.0), self.keeper.idle)[1], "the program's end")


@pytest.fixture
def kept(tmp_path: Path) -> Iterator[Kept]:
    kept = Kept(FakePrograms(tmp_path))
    yield kept
    kept.close()


def test_a_program_is_starting_then_steady(kept: Kept) -> None:
    kept.want("fake")
    kept.step_until_started(1)
    kept.step(STEADY_S)
    (pid,) = kept.programs.pids("fake")
    assert kept.reports == [(State.STARTING, "", pid), (State.RUNNING, "", pid)]


def test_a_killed_program_starts_again_after_a_pause(kept: Kept) -> None:
    kept.want("fake")
    kept.step_until_started(1)
    os.kill(kept.programs.pids("fake")[0], signal.SIGKILL)
    kept.step_until_reported(2)
    assert kept.reports[1] == (State.BACKING_OFF, "was ended by SIGKILL; next start in 0.5 s", None)
    kept.step(0.4)
    assert kept.keeper.idle
    kept.step(0.1)
    kept.step_until_started(2)


def test_a_program_that_keeps_falling_gets_a_rest(kept: Kept) -> None:
    (kept.programs.folder / "crash-fake").touch()
    kept.want("fake")
    for fall in range(1, 8):
        kept.step(8.0)
        kept.step_until_reported(2 * fall)
    assert kept.reports[-1][1] == "ended by itself with code 7; next start in 60 s"


def test_a_bridge_that_lost_its_name_always_starts_again(kept: Kept) -> None:
    (kept.programs.folder / "crash-fake").write_text(str(EXIT_NAME_LOST))
    kept.want("fake")
    for fall in range(1, 9):
        kept.step(2.0)
        kept.step_until_reported(2 * fall)
    lost = "lost its name on the robot's master to another node; next start in 2 s"
    assert kept.reports[-1] == (State.BACKING_OFF, lost, None)


def test_a_bridge_that_could_not_join_its_robot_is_reported(kept: Kept) -> None:
    (kept.programs.folder / "crash-fake").write_text(str(EXIT_NOT_JOINED))
    kept.want("fake")
    kept.step(8.0)
    kept.step_until_reported(2)
    assert "could not join its robot (its log says why)" in kept.reports[-1][1]


def test_the_last_words_of_a_program_are_reported(kept: Kept, tmp_path: Path) -> None:
    socket = tmp_path / "bridge.sock"
    words = partial(last_words.pop, socket, last_words.LAST)
    kept.keeper = Keeper("Fake", lambda *report: kept.reports.append(report), last_words=words)
    last_words.write(
        socket, last_words.LAST, say("it failed ({kind}: {error})", kind="OSError", error="no host")
    )
    (kept.programs.folder / "crash-fake").write_text(str(EXIT_NOT_JOINED))
    kept.want("fake")
    for fall in (2, 4):
        kept.step(8.0)
        kept.step_until_reported(fall)
    first, second = (kept.reports[fall][1] for fall in (1, 3))
    assert first.startswith("it failed (OSError: no host); next start in")
    why = ["it failed ({kind}: {error})", {"kind": "OSError", "error": "no host"}]
    assert isinstance(first, Sentence) and first.parts[1]["why"] == why
    assert second.startswith("could not join its robot (its log says why); next start")


def test_last_words_that_cannot_be_encoded_can_be_sent(tmp_path: Path) -> None:
    socket = tmp_path / "bridge.sock"
    last_words.write(socket, last_words.WHY, say("was ended by {signal}", signal="\udcff"))
    kept = last_words.read(socket, last_words.WHY)
    assert isinstance(kept, Sentence) and kept.parts == ["was ended by {signal}", {"signal": "?"}]
    assert kept == "was ended by ?"


@pytest.mark.parametrize("written", ["could not join its robot", "5"])
def test_last_words_of_the_version_before_are_read(written: str, tmp_path: Path) -> None:
    socket = tmp_path / "bridge.sock"
    last_words.write(socket, last_words.WHY, "")
    (file,) = tmp_path.iterdir()
    file.write_text(written)
    assert last_words.read(socket, last_words.WHY) == written


def test_an_edit_ends_the_old_program_then_starts_the_new(kept: Kept) -> None:
    kept.want("fake", "1")
    kept.step_until_started(1)
    kept.want("fake", "2")
    until(lambda: (kept.step(), len(kept.programs.pids("fake")) == 2)[1], "the new program")
    assert kept.programs.lines() == ["start fake", "end fake", "start fake"]
    assert State.BACKING_OFF not in kept.states()


def test_an_edit_gives_a_resting_program_a_new_chance_at_once(kept: Kept) -> None:
    crash = kept.programs.folder / "crash-fake"
    crash.touch()
    kept.want("fake", "1")
    kept.step_until_started(1)
    kept.step_until_reported(2)
    crash.unlink()
    kept.want("fake", "2")
    kept.step_until_started(2)


def test_a_program_that_cannot_start_is_reported_and_retried(kept: Kept) -> None:
    kept.keeper.want(Program([str(kept.programs.folder / "missing")], {}, "1"))
    kept.step()
    assert kept.reports == [
        (State.BACKING_OFF, "cannot be started: No such file or directory; next start in 0.5 s", None)
    ]


def test_a_program_that_heeds_nothing_is_killed(tmp_path: Path) -> None:
    kept = Kept(FakePrograms(tmp_path, STUBBORN))
    kept.want("fake")
    kept.step_until_started(1)
    kept.keeper.want(None)
    for wait_s in (0.0, TERMINATE_S, KILL_S - TERMINATE_S):
        assert not kept.keeper.idle
        kept.step(wait_s)
    until(lambda: (kept.step(), kept.keeper.idle)[1], "the program's end")
    assert not psutil.pid_exists(kept.programs.pids("fake")[0])


SUPERVISING = """
import os, sys, time
import django
django.setup()
from robots.supervisor.process_keeper import Keeper, Program
keeper = Keeper("Fake", lambda *report: None)
keeper.want(Program([sys.executable, *sys.argv[1:]], dict(os.environ), "1"))
while True:
    keeper.step(time.monotonic())
    time.sleep(0.02)
"""


def test_programs_end_when_their_supervisor_is_killed(tmp_path: Path) -> None:
    programs = FakePrograms(tmp_path)
    environment = {**os.environ, "FAKE_LOG": str(programs.log), "DJANGO_SETTINGS_MODULE": "tests.settings"}
    arguments = [sys.executable, "-c", SUPERVISING, str(programs.script), "fake"]
    with subprocess.Popen(arguments, env=environment) as supervisor:
        (pid,) = until(lambda: programs.pids("fake"), "the program's start")
        child = psutil.Process(pid)
        supervisor.kill()
        child.wait(5.0)
    assert programs.lines() == ["start fake", "end fake"]


def test_a_second_supervisor_is_refused_naming_the_first(tmp_path: Path) -> None:
    lock = tmp_path / "fleet.lock"
    with (
        only_instance(lock),
        pytest.raises(AlreadySupervised, match=str(os.getpid())),
        only_instance(lock),
    ):
        pass
    with only_instance(lock):
        pass


def test_a_living_supervisor_is_known_by_its_lock(tmp_path: Path) -> None:
    lock = tmp_path / "fleet.lock"
    assert not supervised(lock)
    with only_instance(lock):
        assert supervised(lock)
    assert lock.exists() and not supervised(lock)
