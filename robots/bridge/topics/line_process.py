"""A child process that exchanges lines with the bridge: started while needed, restarted when it ends."""

from __future__ import annotations

import asyncio
import logging
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import Protocol

log = logging.getLogger(__name__)

# Pause before a restart: shortest and longest. It doubles until a process lives longer than the latter.
RESTART_S = (1.0, 10.0)
END_S = 2.0  # until a process is killed after its stdin was closed
LARGEST_LINE = 4 * 1024 * 1024  # bytes
LARGEST_BACKLOG = 1024 * 1024  # bytes that the process has not read


class LineProcessOwner(Protocol):
    """The user of a line process."""

    def needed(self) -> bool:
        """Return whether a process must run."""

    def began(self) -> None:
        """Send a new process its initial messages."""

    def handle_line(self, line: bytes) -> None:
        """Take a line from the process. A ValueError ends the process."""

    def ended(self) -> None:
        """Note that the process ended and lost its state."""


class LineProcess:
    """Runs a process while it is needed; lives on the event loop. Each process gets `first_line` first."""

    def __init__(self, command: Sequence[str], first_line: bytes, owner: LineProcessOwner) -> None:
        self._command = command
        self._first_line = first_line
        self._owner = owner
        self._process: Process | None = None
        self._stdin: asyncio.StreamWriter | None = None
        self._end_asked = False  # the process was asked to end
        self._running: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()

    @property
    def lives(self) -> bool:
        """Return whether a process exists, which may be ending."""
        return self._process is not None

    @property
    def listens(self) -> bool:
        """Return whether a process exists that takes lines."""
        return self._stdin is not None

    def need(self) -> None:
        """Make sure that a process runs; returns at once."""
        if self._running is None and not self._closing.is_set():
            self._running = asyncio.get_running_loop().create_task(self._run())

    def send(self, line: bytes) -> bool:
        """Send to the present process. Return False if none takes it."""
        if self._stdin is None or self._stdin.is_closing():
            return False
        if self._stdin.transport.get_write_buffer_size() > LARGEST_BACKLOG:
            self.kill("it does not read its input")
            return False
        self._stdin.write(line + b"\n")
        return True

    def offer(self, line: bytes) -> bool:
        """Send a line that may be lost: return False if no process takes it now."""
        if self._stdin is None or self._stdin.is_closing():
            return False
        if self._stdin.transport.get_write_buffer_size() > LARGEST_BACKLOG:
            return False
        self._stdin.write(line + b"\n")
        return True

    def close_input(self) -> None:
        """Close the process's stdin, so that it ends; kill it after `END_S`. A later `need` starts a new one."""
        self._end_asked = True
        if self._stdin is not None:
            self._stdin.close()
            self._stdin = None
        if self._process is not None:
            asyncio.get_running_loop().call_later(END_S, partial(_kill, self._process))

    def kill(self, why: str) -> None:
        """Kill the process at once. A new one follows."""
        log.error("%s is killed: %s", self._command[-1], why)
        if self._process is not None:
            _kill(self._process)

    async def close(self) -> None:
        """End the process: the bridge ends."""
        self._closing.set()
        self.close_input()
        if self._running is not None:
            await self._running

    def _needed(self) -> bool:
        return self._owner.needed() and not self._closing.is_set()

    async def _run(self) -> None:
        """Run one process after the other while one is needed."""
        shortest_s, longest_s = RESTART_S
        pause_s = 0.0
        try:
            while self._needed():
                began_s = time.monotonic()
                try:
                    await self._one()
                except (OSError, ValueError):  # it cannot start, or sent an invalid line
                    log.exception("%s broke", self._command[-1])
                lived_s = time.monotonic() - began_s
                pause_s = shortest_s if lived_s > longest_s else min(max(2 * pause_s, shortest_s), longest_s)
                if self._needed() and not self._end_asked:
                    with suppress(asyncio.TimeoutError):
                        await asyncio.wait_for(self._closing.wait(), pause_s)
        finally:
            self._running = None

    async def _one(self) -> None:
        """Run one process from its start to its end."""
        process = await asyncio.create_subprocess_exec(
            *self._command, stdin=PIPE, stdout=PIPE, limit=LARGEST_LINE
        )
        assert process.stdin is not None and process.stdout is not None  # noqa: S101  (they are pipes)
        self._process, self._stdin, self._end_asked = process, process.stdin, False
        try:
            self.send(self._first_line)
            if self._closing.is_set():  # `close` was called during the start and found no process to end
                self.close_input()
            else:
                self._owner.began()
            while line := await process.stdout.readline():
                self._owner.handle_line(line)
        finally:
            self._process = self._stdin = None
            process.stdin.close()
            await _ended(process)
            with suppress(OSError):  # unread input is lost
                await process.stdin.wait_closed()
            self._owner.ended()


async def _ended(process: Process) -> None:
    """Wait for a process that has closed its stdout; kill it after the time limit."""
    try:
        await asyncio.wait_for(process.wait(), END_S)
    except TimeoutError:
        _kill(process)
        await process.wait()


def _kill(process: Process) -> None:
    if process.returncode is None:
        with suppress(ProcessLookupError):
            process.kill()
