"""A process that helps the bridge and speaks in lines: kept while it is needed, followed by another where it ends."""

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

RESTART_S = (1.0, 10.0)  # the pause before another process, doubled while none lives for as long
END_S = 2.0  # after its stdin was closed
LARGEST_LINE = 4 * 1024 * 1024  # bytes
LARGEST_BACKLOG = 1024 * 1024  # bytes that the process has not read


class LineProcessOwner(Protocol):
    """The owner of a line process."""

    def needed(self) -> bool:
        """Whether there must be one."""

    def began(self) -> None:
        """One is there, and can be told what it must know."""

    def hear(self, line: bytes) -> None:
        """Handle one line. A ValueError ends the process."""

    def ended(self) -> None:
        """It has ended, and with it whatever it was told."""


class LineProcess:
    """Lives on the event loop. Each process is told `first_line` first."""

    def __init__(self, command: Sequence[str], first_line: bytes, partner: LineProcessOwner) -> None:
        self._command = command
        self._first_line = first_line
        self._partner = partner
        self._process: Process | None = None
        self._stdin: asyncio.StreamWriter | None = None
        self._let_go = False  # the process was told to end
        self._running: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()

    @property
    def lives(self) -> bool:
        """Whether there is a process, which may have been told to end."""
        return self._process is not None

    @property
    def listens(self) -> bool:
        """Whether there is one that can be told something."""
        return self._stdin is not None

    def need(self) -> None:
        """Have a process; returns at once."""
        if self._running is None and not self._closing.is_set():
            self._running = asyncio.get_running_loop().create_task(self._run())

    def send(self, line: bytes) -> bool:
        """To the process that is there now. False: none hears it."""
        if self._stdin is None or self._stdin.is_closing():
            return False
        if self._stdin.transport.get_write_buffer_size() > LARGEST_BACKLOG:
            self.kill("it does not read")
            return False
        self._stdin.write(line + b"\n")
        return True

    def let_go(self) -> None:
        """Close stdin, so that the process ends; kill it after a while. A new need starts a new process."""
        self._let_go = True
        if self._stdin is not None:
            self._stdin.close()
            self._stdin = None
        if self._process is not None:
            asyncio.get_running_loop().call_later(END_S, partial(_kill, self._process))

    def kill(self, why: str) -> None:
        """At once. Another follows."""
        log.error("%s is killed: %s", self._command[-1], why)
        if self._process is not None:
            _kill(self._process)

    async def close(self) -> None:
        """The bridge ends."""
        self._closing.set()
        self.let_go()
        if self._running is not None:
            await self._running

    def _needed(self) -> bool:
        return self._partner.needed() and not self._closing.is_set()

    async def _run(self) -> None:
        """One process after the other, for as long as one is needed."""
        pause_s, longest_s = RESTART_S
        try:
            while self._needed():
                began_s = time.monotonic()
                try:
                    await self._one()
                except (OSError, ValueError):  # it cannot be started, or does not speak as it should
                    log.exception("%s broke", self._command[-1])
                lived_s = time.monotonic() - began_s
                pause_s = RESTART_S[0] if lived_s > longest_s else min(2 * pause_s, longest_s)
                if self._needed() and not self._let_go:
                    with suppress(asyncio.TimeoutError):
                        await asyncio.wait_for(self._closing.wait(), pause_s)
        finally:
            self._running = None

    async def _one(self) -> None:
        """A process from its beginning to its end."""
        process = await asyncio.create_subprocess_exec(
            *self._command, stdin=PIPE, stdout=PIPE, limit=LARGEST_LINE
        )
        assert process.stdin is not None and process.stdout is not None  # noqa: S101  (they are pipes)
        self._process, self._stdin, self._let_go = process, process.stdin, False
        try:
            self.send(self._first_line)
            if self._closing.is_set():  # while this was being started, so that `close` found nothing to end
                self.let_go()
            else:
                self._partner.began()
            while line := await process.stdout.readline():
                self._partner.hear(line)
        finally:
            self._process = self._stdin = None
            process.stdin.close()
            await _ended(process)
            with suppress(OSError):  # at what it read no more
                await process.stdin.wait_closed()
            self._partner.ended()


async def _ended(process: Process) -> None:
    """It has closed its stdout: it ends, or is made to."""
    try:
        await asyncio.wait_for(process.wait(), END_S)
    except asyncio.TimeoutError:
        _kill(process)
        await process.wait()


def _kill(process: Process) -> None:
    if process.returncode is None:
        with suppress(ProcessLookupError):
            process.kill()
