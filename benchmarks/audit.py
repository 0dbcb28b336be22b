"""The audit log: what it costs a driver, records per second, pages of lists and verification with a million records."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import psycopg

from benchmarks.harness import Figure, progress
from benchmarks.parts import recording
from script.stack.places import REPOSITORY
from tests.script.servers import postgresql

COUNTS = (100_000, 1_000_000)
PAGE_MS = 300.0  # the slowest page of a list, whatever is filtered
VERIFIED_S = 10.0  # with the fewer records
WRITTEN_S = 5.0
WRITERS = 4  # processes: two web processes and two bridges
GROWN_MB = 50.0  # of memory, for an export of everything
SIDE = "import django; django.setup(); from benchmarks.parts.audit_side import main; main()"
TITLES = {
    "speechrecord": "Speech history",
    "motionrecord": "Motion history",
    "refusalrecord": "Refusals and gate",
    "record": "Everything",
}


def measure() -> list[Figure]:
    """A driver first; then each database that is installed."""
    with tempfile.TemporaryDirectory(prefix="fleet-bench-") as directory:
        figures = recording.latency(Path(directory))
    for name, database in (("SQLite", sqlite), ("PostgreSQL", own_postgresql)):
        if name == "PostgreSQL" and not list(Path("/usr/lib/postgresql").glob("*/bin")):
            progress("PostgreSQL is not installed")
            continue
        with database() as environment:
            figures += [_named(name, figure) for figure in [*writing(environment), *reading(environment)]]
    return figures


@contextmanager
def sqlite() -> Iterator[dict[str, str]]:
    """The environment of a process with an empty log in a file."""
    with tempfile.TemporaryDirectory(prefix="fleet-bench-") as directory:
        environment = _environment(directory)
        _migrate(environment)
        yield environment


@contextmanager
def own_postgresql() -> Iterator[dict[str, str]]:
    """The same on a server, which forces every commit to the disk, as it does in production."""
    with ExitStack() as stack:
        url = stack.enter_context(postgresql())
        with psycopg.connect(url, autocommit=True) as server:
            server.execute("ALTER SYSTEM SET fsync = on")
            server.execute("SELECT pg_reload_conf()")
        directory = stack.enter_context(tempfile.TemporaryDirectory(prefix="fleet-bench-"))
        environment = {**_environment(directory), "FLEET_DATABASE_URL": url}
        _migrate(environment)
        yield environment


def writing(environment: dict[str, str]) -> list[Figure]:
    """Records per second, committed."""
    progress("writing ...")
    alone, together = _written(environment, 1), _written(environment, WRITERS)
    return [
        Figure("records written, one process", alone, "/s"),
        Figure(f"records written, {WRITERS} processes", together, "/s"),
    ]


def reading(environment: dict[str, str]) -> list[Figure]:
    """Pages, verification and export, as the log grows."""
    progress("filling and reading ...")
    figures = []
    slowest: dict[tuple[int, str], tuple[float, str]] = {}
    for told in _told(_start(environment, "reading", *map(str, COUNTS))):
        if "page" in told:
            key = (told["count"], told["page"])
            slowest[key] = max(slowest.get(key, (0.0, "")), (told["ms"], told["query"]))
        elif "verified_s" in told:
            figures += _of_pages(told["count"], slowest)
            figures += _of_verification(told)
        else:
            figures += _of_export(told)
    return figures


def _of_pages(count: int, slowest: dict[tuple[int, str], tuple[float, str]]) -> list[Figure]:
    figures = []
    for (of, page), (ms, query) in slowest.items():
        if of == count:
            progress(f"{count:,} records, {TITLES[page]}: slowest with {query or 'nothing'!r}")
            figures.append(Figure(f"{count:,} records: {TITLES[page]}, slowest page", ms, "ms", PAGE_MS))
    return figures


def _of_verification(told: dict[str, Any]) -> list[Figure]:
    count = told["count"]
    limit = VERIFIED_S if count == COUNTS[0] else None
    return [
        Figure(f"{count:,} records: verified", told["verified_s"], "s", limit),
        Figure(f"{count:,} records: findings", told["findings"], "", 0.0),
    ]


def _of_export(told: dict[str, Any]) -> list[Figure]:
    return [
        Figure(f"{told['count']:,} records: exported", told["exported_s"], "s"),
        Figure(f"{told['count']:,} records: export is", told["mb"], "MB"),
        Figure(f"{told['count']:,} records: export takes memory", told["grown_mb"], "MB", GROWN_MB),
    ]


def _written(environment: dict[str, str], processes: int) -> float:
    """All together, in one second."""
    writers = [_start(environment, "writing", str(WRITTEN_S)) for _ in range(processes)]
    for writer in writers:
        if writer.stdin:
            writer.stdin.close()
    return float(sum(told["per_s"] for writer in writers for told in _told(writer)))


def _start(environment: dict[str, str], *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603 - our own command
        [sys.executable, "-c", SIDE, *words],
        cwd=REPOSITORY,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _told(process: subprocess.Popen[str]) -> Iterator[dict[str, Any]]:
    with process:
        try:
            for line in process.stdout or ():
                yield json.loads(line)
        finally:
            if process.poll() is None and process.stdin:
                process.terminate()
    if process.returncode:
        raise RuntimeError(f"{process.args!r} ended with {process.returncode}")


def _environment(directory: str) -> dict[str, str]:
    own = {name: value for name, value in os.environ.items() if not name.startswith(("FLEET_", "DJANGO_"))}
    return {
        **own,
        "DJANGO_SETTINGS_MODULE": "fleet.settings",
        "FLEET_VAR": directory,
        "FLEET_DEBUG": "1",
        "FLEET_HOSTS": "testserver",
    }


def _migrate(environment: dict[str, str]) -> None:
    command = [sys.executable, "manage.py", "migrate", "--verbosity", "0"]
    subprocess.run(command, cwd=REPOSITORY, env=environment, check=True)  # noqa: S603 - our own command


def _named(database: str, figure: Figure) -> Figure:
    return Figure(f"{database}: {figure.name}", figure.value, figure.unit, figure.limit)
