"""Child processes that end with this process at the latest, and an orderly end after a signal.

Each child is in its own process group, so that Ctrl-C in a terminal reaches only the parent, which then ends its
children in order. If the parent is killed before that, the kernel sends SIGTERM to every child (the parent-death
signal).
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from types import FrameType
from typing import NoReturn

from fleet.base.logs import for_journal
from script.stack.places import REPOSITORY

LAST_LINES = 15
DOMAINS = 100  # of ROS 2; ports of higher domains are those of outgoing connections
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# If the parent was killed just before this call, the signal never comes. So the shell checks that the parent is alive.
TIED_TO_US = ("/usr/bin/setpriv", "--pdeathsig", "TERM", "/bin/sh", "-c", 'test $PPID = "$0" && exec "$@"')


# Write Python's stack to the log when a signal such as SIGSEGV ends a process. Children inherit the setting.
LAST_WORDS = {"PYTHONFAULTHANDLER": "1"}


class Ended(BaseException):
    """A signal asked this process to end; the text is the signal's name."""


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Context: raise `Ended` on the first Ctrl-C, SIGTERM or closed terminal. Ignore later signals."""

    def end(heard: int, _frame: FrameType | None) -> NoReturn:
        for number in ENDING_SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        raise Ended(signal.Signals(heard).name)

    for number in ENDING_SIGNALS:
        signal.signal(number, end)
    yield


def say(text: str, level: int = logging.INFO) -> None:
    """Print to the terminal, or with this level to the journal. If the terminal is closed, do nothing."""
    try:
        print(for_journal(text, level, sys.stdout), flush=True)
    except OSError:
        return


class ChildDied(RuntimeError):
    """A process that should run has ended. The message contains its name and its last log lines."""

    def __init__(self, child: Child) -> None:
        self.child = child
        last = f" Its last lines ({child.log}):\n{child.last_lines()}" if child.log else ""
        super().__init__(f"{child.name} {child.fate()}.{last}")


class Child:
    """A child process in the repository's folder, with its own log file if `log` is given.

    Start children from the main thread: the parent-death signal comes when the *thread* that started them ends.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        *,
        env: Mapping[str, str],
        log: Path | None = None,
        fds: Sequence[int] = (),
    ) -> None:
        if threading.current_thread() is not threading.main_thread():
            raise RuntimeError(
                f"{name} would end with the thread that starts it: start it from the main thread"
            )
        self.name = name
        self.log = log
        with log.open("ab") if log else nullcontext() as output:
            self.process = subprocess.Popen(  # noqa: S603 - our own commands
                [*TIED_TO_US, str(os.getpid()), *command],
                cwd=REPOSITORY,
                env=dict(env) | LAST_WORDS,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                pass_fds=fds,
            )

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def running(self) -> bool:
        return self.process.poll() is None

    def fate(self) -> str:
        """Return how the process ended, as the second half of a sentence."""
        code = self.process.poll()
        if code is None:
            return "is running"
        if code < 0:
            return f"was ended by {signal.Signals(-code).name}"
        return f"ended with status {code}"

    def last_lines(self) -> str:
        """Return the last lines of the child's log."""
        if self.log is None:
            return ""
        return "\n".join(self.log.read_text(errors="replace").splitlines()[-LAST_LINES:])

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the process only; the process ends its own children."""
        if self.running:
            self.process.send_signal(number)

    def wait(self, timeout_s: float) -> bool:
        """Wait at most `timeout_s`; return whether the process has ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout_s)
            return True
        return False

    def kill_group(self) -> None:
        """Send SIGKILL to all remaining processes of the child's process group."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self.process.wait()


def end_all(children: Iterable[Child], *, patience_s: float = 8.0) -> None:
    """End these children together: send SIGTERM, wait at most `patience_s`, then send SIGKILL."""
    children = list(children)
    for child in children:
        child.signal(signal.SIGTERM)
    deadline = time.monotonic() + patience_s
    for child in children:
        if not child.wait(max(0.0, deadline - time.monotonic())):
            print(f"{child.name} did not end in {patience_s:g} s and is killed.", file=sys.stderr)
        child.kill_group()


def wait_for_any_end(children: Sequence[Child]) -> Child:
    """Wait until one of these has ended, and return it. An exception of a signal handler ends the wait."""
    while True:
        if ended := ended_within(children, None):
            return ended


def ended_within(children: Sequence[Child], timeout_s: float | None) -> Child | None:
    """Wait as `wait_for_any_end` does, at most `timeout_s`; return None if all still run."""
    poll = select.poll()
    by_fd = {os.pidfd_open(child.pid): child for child in children}
    try:
        for fd in by_fd:
            poll.register(fd, select.POLLIN)
        ended = poll.poll(None if timeout_s is None else timeout_s * 1000)
        return by_fd[ended[0][0]] if ended else None
    finally:
        for fd in by_fd:
            os.close(fd)


class ReservedDomain:
    """Reserve a domain of ROS 2 on this computer, among programs that reserve theirs so, until `close`."""

    def __init__(self) -> None:
        for at in range(os.getpid(), os.getpid() + DOMAINS):
            self.number = 1 + at % DOMAINS
            with contextlib.suppress(OSError), ExitStack() as opened:  # taken, or another user's file
                lock = (Path(tempfile.gettempdir()) / f"ros-domain-{self.number}").open("w")
                opened.callback(lock.close)
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self.close = opened.pop_all().close
                return
        raise OSError("no domain of ROS 2 is free")


class ReservedPort:
    """Reserve a free loopback port until a child listens there.

    Binds the port without listening: then the kernel gives it to nobody who asks for any free port, but a server
    with SO_REUSEADDR can bind it.
    """

    def __init__(self, host: str = "127.0.0.1") -> None:
        self.host = host
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind((host, 0))
        self.number: int = self._socket.getsockname()[1]

    def close(self) -> None:
        self._socket.close()
