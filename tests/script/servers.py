"""A PostgreSQL and a Redis of a test's own, on Unix sockets, which end with the test."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from script.stack.processes import Child
from tests.script.support import outside, until

OWNER = "postgres"  # by Debian's package; PostgreSQL does not run as root
STARTED_S = 10.0
POSTGRESQL_END = signal.SIGQUIT  # at once; SIGTERM would wait for its clients


@contextmanager
def postgresql() -> Iterator[str]:
    """Its `FLEET_DATABASE_URL`. What it writes is not forced to the disk."""
    programs = max(Path("/usr/lib/postgresql").glob("*/bin"))
    directory = Path(tempfile.mkdtemp(prefix="fleet-pg-"))
    tie = ["/usr/bin/setpriv", f"--pdeathsig={POSTGRESQL_END.name.removeprefix('SIG')}"]
    if os.getuid() == 0:
        shutil.chown(directory, OWNER)
        tie += [f"--reuid={OWNER}", f"--regid={pwd.getpwnam(OWNER).pw_gid}", "--clear-groups"]
    try:
        make = [programs / "initdb", "-D", directory / "data", "-U", "fleet", "-A", "trust", "--no-sync"]
        subprocess.run([*tie, *map(str, make)], check=True, cwd="/", stdout=subprocess.DEVNULL)
        run = ["-D", directory / "data", "-k", directory, "-c", "listen_addresses=", "-c", "fsync=off"]
        server = Child(
            "postgresql",
            [*tie, *map(str, [programs / "postgres", *run])],
            env=outside(),
            log=directory / "log",
        )
        try:
            ready = [str(programs / "pg_isready"), "-q", "-h", str(directory)]
            until(lambda: subprocess.run(ready).returncode == 0, "PostgreSQL answers", STARTED_S)
            yield f"postgresql://fleet@/postgres?host={directory}"
        finally:
            server.signal(POSTGRESQL_END)
            server.wait(STARTED_S)
    finally:
        shutil.rmtree(directory)


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
