"""Keeps programs running: a bridge and a watchdog for each robot, restarted with growing pauses.

The stdin of each program is the read end of a pipe: the life line. The pipe closes when the supervisor wants the
program to end, or when the supervisor dies, even if it is killed. Then the program stops its robot and exits. Each
program runs in its own session: a Ctrl-C in the terminal reaches only the supervisor, which then ends all programs in
order.

All times are arguments: seconds of one monotonic clock.
"""

from __future__ import annotations

import contextlib
import logging
import signal
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from robots.registry.models import BridgeStatus
from robots.shared.processes.restarts import RestartBudget
from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING, EXIT_NAME_LOST, EXIT_NOT_JOINED
from robots.shared.sentences import Sentence, catalogued, say

State = BridgeStatus.State
Report = Callable[[State, str, int | None], None]  # state, detail in words, process id

log = logging.getLogger(__name__)

STEADY_S = 2.0  # a program that has lived this long has started
TERMINATE_S = 3.0  # after the life line was closed
KILL_S = 4.5
NAME_LOST_S = 2.0  # pause after a lost name; not the program's fault, so the budget does not count it
NEXT_START = catalogued("{why}; next start in {wait:g} s")


@dataclass(frozen=True)
class Program:
    """A program to run. Programs with the same digest are the same."""

    arguments: list[str]
    environment: Mapping[str, str]
    digest: str
    fresh: Callable[[], Mapping[str, str]] = dict  # variables of each start; an OSError says why it must wait


class Keeper:
    """Keeps one program running, replaces it by another, or ends it."""

    def __init__(
        self,
        name: str,
        report: Report,
        budget: Callable[[], RestartBudget] = RestartBudget,
        last_words: Callable[[], str] = str,
    ) -> None:
        """`last_words` returns what the program wrote about its end; empty if it wrote nothing."""
        self._name = name
        self._report = report
        self._new_budget = budget
        self._last_words = last_words
        self._budget = budget()
        self._wanted: Program | None = None
        self._running: Program | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._since_s = 0.0  # start of the process
        self._steady = False
        self._ending_s: float | None = None  # when the life line of the process was closed
        self._start_at_s = 0.0

    @property
    def digest(self) -> str | None:
        """Return the digest of the wanted program."""
        return self._wanted.digest if self._wanted else None

    @property
    def idle(self) -> bool:
        """Return whether no program runs."""
        return self._process is None

    def want(self, program: Program | None) -> None:
        """Keep this program running from the next step on; None: no program."""
        self._wanted = program
        self._budget = self._new_budget()
        self._start_at_s = 0.0

    def step(self, now_s: float) -> None:
        """Check the process; start, end or kill it if that is due. Never waits."""
        if self._process is not None:
            self._watch(self._process, now_s)
        if self._process is None and self._wanted is not None and now_s >= self._start_at_s:
            self._start(self._wanted, now_s)

    def _start(self, program: Program, now_s: float) -> None:
        try:
            self._process = subprocess.Popen(  # noqa: S603 - the arguments are our own
                program.arguments,
                env={**program.environment, **program.fresh()},
                stdin=subprocess.PIPE,
                start_new_session=True,
            )
        except OSError as error:
            wait_s = self._budget.wait_s(now_s)
            self._plan_restart(
                State.BACKING_OFF, say("cannot be started: {error}", error=error.strerror), wait_s, now_s
            )
            return
        self._running, self._since_s, self._steady, self._ending_s = program, now_s, False, None
        log.info("%s starts as process %s", self._name, self._process.pid)
        self._report(State.STARTING, "", self._process.pid)

    def _watch(self, process: subprocess.Popen[bytes], now_s: float) -> None:
        code = process.poll()
        if code is not None:
            self._ended(process, code, now_s)
        elif self._wanted is None or self._wanted is not self._running:
            self._end(process, now_s)
        elif not self._steady and now_s - self._since_s >= STEADY_S:
            self._steady = True
            self._report(State.RUNNING, "", process.pid)

    def _end(self, process: subprocess.Popen[bytes], now_s: float) -> None:
        """Close the life line; if the program does not end, send it SIGTERM and later SIGKILL."""
        if self._ending_s is None:
            self._ending_s = now_s
            _close_life_line(process)
        elif now_s - self._ending_s >= KILL_S:
            log.warning("%s did not end: killed", self._name)
            process.kill()
        elif now_s - self._ending_s >= TERMINATE_S:
            process.terminate()

    def _ended(self, process: subprocess.Popen[bytes], code: int, now_s: float) -> None:
        _close_life_line(process)
        self._process = self._running = None
        if self._ending_s is not None:
            log.info("%s ended as it was asked to", self._name)
        else:
            state = State.REFUSED if code == EXIT_ALREADY_RUNNING else State.BACKING_OFF
            wait_s = NAME_LOST_S if code == EXIT_NAME_LOST else self._budget.wait_s(now_s)
            self._plan_restart(state, self._last_words() or _in_words(code), wait_s, now_s)

    def _plan_restart(self, state: State, why: str, wait_s: float, now_s: float) -> None:
        self._start_at_s = now_s + wait_s
        detail = say(NEXT_START, why=why, wait=wait_s)
        log.warning("%s %s", self._name, detail)
        self._report(state, detail, None)


def _close_life_line(process: subprocess.Popen[bytes]) -> None:
    if process.stdin is not None:
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()


def _in_words(code: int) -> Sentence:
    if code == EXIT_ALREADY_RUNNING:
        return say("found another bridge of this robot on this computer")
    if code == EXIT_NAME_LOST:
        return say("lost its name on the robot's master to another node")
    if code == EXIT_NOT_JOINED:
        return say("could not join its robot (its log says why)")
    if code < 0:
        return say("was ended by {signal}", signal=signal.Signals(-code).name)
    return say("ended by itself with code {code}", code=str(code))
