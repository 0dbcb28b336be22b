"""Claims: one supervisor runs a robot, of all computers that share the database.

In PostgreSQL a claim is an advisory lock of the supervisor's session. It ends with the session: when the supervisor
ends, or after its computer has been out of reach for half a minute. When the connection breaks, all programs go on; the
supervisor claims its robots again, and leaves those that another one has claimed meanwhile.

SQLite serves one computer: `sole_supervisor` locks a file beside the database. An upgrade has a lock of its own.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import UUID

from django.conf import settings
from django.db import DatabaseError, connection

from robots.shared.processes.one_supervisor import LOCK, AlreadySupervised, only_instance

CONSOLE = UUID(int=0)  # claimed by the supervisor of all robots that no other computer runs
_UPGRADE = 1  # the key of the lock of an upgrade; those of claims are parts of UUIDs
_NAME = "fleet supervisor on "
_BEGIN = (
    "SELECT set_config('application_name', %s, false), set_config('tcp_keepalives_idle', '10', false),"
    " set_config('tcp_keepalives_interval', '5', false), set_config('tcp_keepalives_count', '3', false)"
)
_TAKE = """
SELECT key, pg_try_advisory_lock(key), (
    SELECT ARRAY[pid::text, coalesce(application_name, 'another computer')]
    FROM pg_locks JOIN pg_stat_activity USING (pid)
    WHERE locktype = 'advisory' AND granted AND objsubid = 1 AND datname = current_database()
    AND (classid::bigint << 32 | objid::bigint) = key
) FROM unnest(%s::bigint[]) AS key
"""

_SUPERVISORS = """
SELECT application_name FROM pg_stat_activity
WHERE datname = current_database() AND application_name LIKE %s
"""


@contextmanager
def sole_supervisor() -> Iterator[None]:
    """Context: the only supervisor with this run directory, and with this file of SQLite. Raises AlreadySupervised."""
    with only_instance(settings.FLEET_RUN_DIR / LOCK):
        if connection.vendor != "sqlite":
            yield
            return
        with only_instance(Path(f"{connection.settings_dict['NAME']}.lock")):
            yield


@contextmanager
def sole_upgrade(waits: Callable[[], object]) -> Iterator[None]:
    """Context: the only upgrade of this PostgreSQL, on all computers. Calls `waits` before it waits for another one.

    With SQLite, `sole_supervisor` is enough.
    """
    if connection.vendor != "postgresql":
        yield
        return
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_try_advisory_lock(%s)", [_UPGRADE])
        if not cursor.fetchone()[0]:
            waits()
            cursor.execute("SELECT pg_advisory_lock(%s)", [_UPGRADE])
    try:
        yield
    finally:
        with suppress(DatabaseError), connection.cursor() as cursor:  # else it ends with the session
            cursor.execute("SELECT pg_advisory_unlock(%s)", [_UPGRADE])


def require_no_supervisor() -> None:
    """Raise `AlreadySupervised` if a supervisor of any computer has a session with this PostgreSQL."""
    if connection.vendor != "postgresql":
        return
    with connection.cursor() as cursor:
        cursor.execute(_SUPERVISORS, [_NAME + "%"])
        if found := cursor.fetchone():
            raise AlreadySupervised(found[0].removeprefix(_NAME))


class Claims:
    """The claims of this supervisor."""

    def __init__(self, computer: str = "") -> None:
        self._name = f"{_NAME}{(computer or socket.gethostname())[:28]}, process {os.getpid()}"
        self._session: object = None  # the connection that holds the locks
        self._own: set[str] = set()  # the server's processes for this session and earlier ones
        self._held: set[UUID] = set()

    def take(self, wanted: Collection[UUID]) -> dict[UUID, str]:
        """Claim these. Return those that another supervisor has, each with its computer and process."""
        if connection.vendor != "postgresql":
            return {}
        connection.ensure_connection()
        if connection.connection is not self._session:
            self._begin()
        missing = {_key(one): one for one in wanted if one not in self._held}
        if not missing:
            return {}
        with connection.cursor() as cursor:
            cursor.execute(_TAKE, [list(missing)])
            found = cursor.fetchall()
        self._held |= {missing[key] for key, got, _ in found if got}
        # No holder: the lock has just become free. An own one: a session that the server has not missed yet. Names do
        # not tell: supervisors in two containers may have the same number of process.
        others = [(key, *holder) for key, got, holder in found if not got and holder]
        return {missing[key]: name.removeprefix(_NAME) for key, pid, name in others if pid not in self._own}

    def keep(self, wanted: Collection[UUID]) -> None:
        """Give all other claims back."""
        for left in self._held - set(wanted):
            with connection.cursor() as cursor:
                cursor.execute("SELECT pg_advisory_unlock(%s)", [_key(left)])
            self._held.discard(left)

    def _begin(self) -> None:
        """Name the session for other supervisors, and let the server notice soon that this computer has vanished."""
        with connection.cursor() as cursor:
            cursor.execute(_BEGIN, [self._name])
        self._session, self._held = connection.connection, set()
        self._own.add(str(connection.connection.info.backend_pid))


def _key(claimed: UUID) -> int:
    """Return the key of the advisory lock: 64 bits, signed."""
    return int.from_bytes(claimed.bytes[:8], signed=True)
