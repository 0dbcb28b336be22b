"""Temporary PostgreSQL and Redis servers on Unix sockets."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from benchmarks.parts.process_stats import children
from script.stack.processes import Child
from tests.processes import free_port, outside, until
from tests.script.support import Family

PROGRAMS = Path("/usr/lib/postgresql")
OWNER = "postgres"  # the account of Debian's package: PostgreSQL does not run as root
MEMORY = Path("/dev/shm")  # noqa: S108 - mkdtemp makes a new folder there
ROOM_BYTES = 1 << 30
STARTED_S = 30.0
POSTGRESQL_END = signal.SIGQUIT  # an immediate end: with SIGTERM, PostgreSQL would wait for its clients


def postgresql_installed() -> bool:
    """Return whether PostgreSQL's programs are installed."""
    return any(PROGRAMS.glob("*/bin"))


class Postgresql:
    """A PostgreSQL server; `url` is its `FLEET_DATABASE_URL`. If it is not `durable`, it runs without fsync.

    With an `address` of this computer it listens there, as for other computers.
    """

    def __init__(self, directory: Path, durable: bool, address: str = "") -> None:
        self._options = [] if durable else ["-c", "fsync=off", "-c", "max_wal_size=128MB"]
        self._programs = max(PROGRAMS.glob("*/bin"))
        self._directory = directory
        self._tie = ["/usr/bin/setpriv", f"--pdeathsig={POSTGRESQL_END.name.removeprefix('SIG')}"]
        if os.getuid() == 0:
            shutil.chown(directory, OWNER)
            self._tie += [f"--reuid={OWNER}", f"--regid={pwd.getpwnam(OWNER).pw_gid}", "--clear-groups"]
        place = ["-D", str(directory / "data"), "-U", "fleet"]
        make = self._command("initdb", *place, "-A", "trust", "--no-sync")
        subprocess.run([*self._tie, *make], check=True, cwd="/", stdout=subprocess.DEVNULL)
        self.url = f"postgresql://fleet@/postgres?host={directory}"
        if address:
            with (directory / "data" / "pg_hba.conf").open("a") as admitted:
                admitted.write(f"host all all {address}/32 trust\n")
            port = free_port()
            self._options += ["-c", f"listen_addresses={address}", "-c", f"port={port}"]
            self.url = f"postgresql://fleet@{address}:{port}/postgres"
        self.start()

    def start(self) -> None:
        """Start the server and wait until it answers."""
        place = self._command("postgres", "-D", self._directory / "data", "-k", self._directory)
        run = [*place, "-c", "listen_addresses=", *self._options]
        log = self._directory / "log"
        self._server = Child("postgresql", [*self._tie, *run], env=outside(), log=log)
        ready = self._command("pg_isready", "-q", "-d", self.url)
        until(lambda: subprocess.run(ready).returncode == 0, "PostgreSQL answers", STARTED_S)

    def _command(self, program: str, *words: str | Path) -> list[str]:
        return [str(self._programs / program), *map(str, words)]

    def signal_all(self, number: signal.Signals) -> None:
        """Send a signal to the server and to all its processes."""
        for pid in (self._server.pid, *children(self._server.pid)):
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    def kill(self) -> None:
        """Kill all processes of the server (SIGKILL) and wait until they have ended."""
        family = Family(self._server.pid)
        self.signal_all(signal.SIGKILL)
        self._server.wait(STARTED_S)
        family.assert_gone()

    def end(self) -> None:
        """End the server immediately."""
        self._server.signal(POSTGRESQL_END)
        self._server.wait(STARTED_S)


@contextmanager
def running_postgresql(*, durable: bool = False, address: str = "") -> Iterator[Postgresql]:
    """Run a PostgreSQL that a test can kill and start again. If it is `durable`, its data are on the disk."""
    # In memory, if there is room: a database has hundreds of files, and tests make dozens of databases.
    in_memory = not durable and MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > ROOM_BYTES
    directory = Path(tempfile.mkdtemp(prefix="fleet-pg-", dir=MEMORY if in_memory else None))
    try:
        server = Postgresql(directory, durable, address)
        try:
            yield server
        finally:
            server.end()
    finally:
        shutil.rmtree(directory)


@contextmanager
def postgresql(*, durable: bool = False) -> Iterator[str]:
    """Run a PostgreSQL; yield its `FLEET_DATABASE_URL`."""
    with running_postgresql(durable=durable) as server:
        yield server.url


class Redis:
    """A redis-server; `url` is its `FLEET_REDIS_URL`."""

    def __init__(self, directory: Path) -> None:
        path = directory / "redis"
        self.url = f"unix://{path}"
        words = ["--port", "0", "--unixsocket", str(path), "--save", "", "--dir", str(directory)]
        self._server = Child(
            "redis", ["/usr/bin/redis-server", *words], env=outside(), log=directory / "redis.log"
        )
        until(path.is_socket, "Redis listens", STARTED_S)

    def kill(self) -> None:
        self._server.kill_group()
