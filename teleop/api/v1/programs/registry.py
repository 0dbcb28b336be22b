"""The connections of all programs in this process, by program and robot."""

from __future__ import annotations

import asyncio
import os
import time
from uuid import UUID

from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.api.v1.programs.connection import ProgramConnection, ProgramSignIn

SOCKET = "FLEET_PROGRAMS_SOCKET"  # where the web process listens; set by `fleet.server.pages.process`
UNUSED_S = 30.0  # without a request, a program's connection closes, and control ends
CHECK_S = 1.0
MOST = 100
MOST_OF_PERSON = 20

_NO_SERVER = Refusal(
    "no_programs",
    "This process has no way to robots: control by programs needs the console's server.",
    "robot",
)
_FULL = Refusal("busy", "Too many programs are connected: try again later.", "robot")
_FULL_OF_YOURS = Refusal(
    "busy",
    say("Your programs have {most} connections: release control on some robots first.", most=MOST_OF_PERSON),
    "robot",
)


class _Entry:
    """The connection of one program to one robot."""

    def __init__(self, person: UUID) -> None:
        self.person = person
        self.opening = asyncio.Lock()
        self.users = 0  # requests that open the connection, or wait for it
        self.connection: ProgramConnection | None = None

    @property
    def open_connection(self) -> ProgramConnection | None:
        found = self.connection
        return found if found is not None and found.is_open else None

    def unused(self, now_s: float) -> bool:
        found = self.open_connection
        return not self.users and (found is None or now_s - found.used_s > UNUSED_S)


class Programs:
    """Opens connections when they are needed, and closes those that are no longer used."""

    def __init__(self) -> None:
        self._entries: dict[tuple[str, str], _Entry] = {}
        self._cleaning: asyncio.Task[None] | None = None

    async def connection(self, slug: str, sign_in: ProgramSignIn) -> ProgramConnection:
        """Return the program's connection to a robot. Raises `NotDone`."""
        key = (sign_in.key, slug)
        path = self.path()
        if key not in self._entries:
            self._require_room(sign_in)
        entry = self._entries.setdefault(key, _Entry(sign_in.person))
        if self._cleaning is None or self._cleaning.done():
            self._cleaning = asyncio.create_task(self._clean())
        entry.users += 1
        try:
            async with entry.opening:
                found = entry.open_connection
                if found is None:
                    found = entry.connection = await ProgramConnection.open(path, slug, sign_in)
        finally:
            entry.users -= 1
        found.used_s = time.monotonic()
        return found

    def found(self, slug: str, sign_in: ProgramSignIn) -> ProgramConnection | None:
        """Return the program's open connection to a robot; None: there is none."""
        entry = self._entries.get((sign_in.key, slug))
        found = entry.open_connection if entry else None
        if found is not None:
            found.used_s = time.monotonic()
        return found

    def path(self) -> str:
        """Return the path of the socket of the web process. Raises `NotDone`."""
        path = os.environ.get(SOCKET)
        if not path:
            raise NotDone(_NO_SERVER)
        return path

    def _require_room(self, sign_in: ProgramSignIn) -> None:
        if len(self._entries) >= MOST:
            raise NotDone(_FULL)
        if sum(entry.person == sign_in.person for entry in self._entries.values()) >= MOST_OF_PERSON:
            raise NotDone(_FULL_OF_YOURS)

    async def _clean(self) -> None:
        """Close unused connections, all at the same time: one that does not answer delays no other."""
        while self._entries:
            await asyncio.sleep(CHECK_S)
            now_s = time.monotonic()
            unused = {key: entry for key, entry in self._entries.items() if entry.unused(now_s)}
            for key in unused:
                del self._entries[key]
            closing = [entry.connection.close() for entry in unused.values() if entry.connection]
            await asyncio.gather(*closing)


programs = Programs()
