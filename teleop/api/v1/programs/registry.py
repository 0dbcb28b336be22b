"""The connections of all programs in this process, by program and robot."""

from __future__ import annotations

import asyncio
import os
import time

from robots.wire import NotDone, Refusal
from teleop.api.v1.programs.connection import Caller, ProgramConnection

SOCKET = "FLEET_PROGRAMS_SOCKET"  # where the process that drives listens for us; `fleet.server.pages` sets it
UNUSED_S = 30.0  # without a request, a program's connection closes, and control ends
LOOK_S = 1.0
MOST = 100

_NO_SERVER = Refusal(
    "no_programs",
    "This process has no way to robots: control by programs needs the console's server.",
    "robot",
)
_FULL = Refusal("busy", "Too many programs are connected: try again later.", "robot")


class Programs:
    """Opens connections when they are needed, and closes those that are no longer used."""

    def __init__(self) -> None:
        self._open: dict[tuple[str, str], ProgramConnection] = {}
        self._opening: dict[tuple[str, str], asyncio.Lock] = {}
        self._cleaning: asyncio.Task[None] | None = None

    async def connection(self, slug: str, caller: Caller) -> ProgramConnection:
        """Return the program's connection to a robot. Raises `NotDone`."""
        key = (caller.key, slug)
        if self._cleaning is None or self._cleaning.done():
            self._cleaning = asyncio.create_task(self._clean())
        lock = self._opening.setdefault(key, asyncio.Lock())
        async with lock:
            found = self._open.get(key)
            if found is None or not found.open_now:
                found = self._open[key] = await ProgramConnection.open(self.path(), slug, caller)
        found.used_s = time.monotonic()
        return found

    def found(self, slug: str, caller: Caller) -> ProgramConnection | None:
        """Return the connection if there is one; None: the program has asked for nothing yet."""
        found = self._open.get((caller.key, slug))
        if found is None or not found.open_now:
            return None
        found.used_s = time.monotonic()
        return found

    def path(self) -> str:
        """Return where the process that drives listens. Raises `NotDone`."""
        path = os.environ.get(SOCKET)
        if not path:
            raise NotDone(_NO_SERVER)
        if len(self._open) >= MOST:
            raise NotDone(_FULL)
        return path

    async def _clean(self) -> None:
        while self._open:
            await asyncio.sleep(LOOK_S)
            for key, one in list(self._open.items()):
                if not one.open_now or time.monotonic() - one.used_s > UNUSED_S:
                    del self._open[key]
                    self._opening.pop(key, None)
                    await one.close()


programs = Programs()
