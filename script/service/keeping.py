"""Keep the processes of `script/serve` running: one that ends is started again alone, and the others go on."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Sequence
from typing import NoReturn

from robots.shared.processes.restarts import RestartBudget
from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING
from script.stack.processes import Child, ChildDied, end_all, ended_within, say

READY_STEP_S = 0.1


class Kept:
    """A process that is started again when it ends: soon, and after many ends a minute later."""

    def __init__(self, name: str, command: Sequence[str]) -> None:
        self.name = name
        self._command = command
        self._budget = RestartBudget()
        self.child: Child | None = None
        self.start_at_s = 0.0

    def step(self, now_s: float) -> None:
        """Start the process if that is due."""
        if self.child is None and now_s >= self.start_at_s:
            self.child = Child(self.name, self._command, env=os.environ)

    def ended(self, child: Child, now_s: float) -> str:
        """Plan the next start, and return what people should know."""
        self.child = None
        refused = child.process.poll() == EXIT_ALREADY_RUNNING  # it said who does its work
        wait_s = self._budget.rest_s if refused else self._budget.wait_s(now_s)
        self.start_at_s = now_s + wait_s
        often = ""
        if wait_s == self._budget.rest_s and not refused:
            often = f" It has ended more than {self._budget.falls} times within {self._budget.window_s:g} s:"
            often += " the lines above say why."
        return f"{self.name} {child.fate()}; it is started again in {wait_s:g} s.{often}"


def keep(processes: Sequence[Kept], ready: Callable[[], bool], introduce: Callable[[], None]) -> NoReturn:
    """Run the processes until a signal ends this one; call `introduce` once, when they are `ready`.

    Raises `ChildDied` if one ends before that, as with a wrong setting. One that ends later because another one does
    its work tries again each minute, beside the others; without others, it ends this process, too.
    """
    introduced = False
    try:
        while True:
            for each in processes:
                each.step(time.monotonic())
            if not introduced and ready():
                introduced = True
                introduce()
            by_child = {each.child: each for each in processes if each.child}
            ended = ended_within(list(by_child), _patience_s(processes) if introduced else READY_STEP_S)
            if ended is None:
                continue
            if not introduced or (len(processes) == 1 and ended.process.poll() == EXIT_ALREADY_RUNNING):
                raise ChildDied(ended)
            say(by_child[ended].ended(ended, time.monotonic()), logging.WARNING)
    finally:
        end_all(each.child for each in processes if each.child)


def _patience_s(processes: Sequence[Kept]) -> float | None:
    """Return the time (s) until the next start; None if all processes run."""
    due = [each.start_at_s for each in processes if each.child is None]
    return max(0.0, min(due) - time.monotonic()) if due else None
