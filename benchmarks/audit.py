"""The audit log: what it costs a driver, records per second, pages of lists and verification with a million records.

FLEET_BENCH_PARTS names the parts to run: latency, sqlite, postgresql. FLEET_BENCH_COUNTS: with how many records.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import psycopg

from benchmarks.harness import Figure, progress
from benchmarks.parts.audit import recording_cost
from script.stack.places import REPOSITORY
from tests.script.servers import postgresql, postgresql_installed

COUNTS = [int(count) for count in os.environ.get("FLEET_BENCH_COUNTS", "100000 1000000").split()]
PAGE_MS = 300.0  # the slowest page of a list, whatever is filtered
VERIFIED_S = 10.0
VERIFIED_COUNT = 100_000  # records, at most, in that time
WRITTEN_S = 5.0
WRITERS = 4  # processes: two web processes and two bridges
GROWN_MB = 50.0  # of memory, for an export of everything
SIDE = "import django; django.setup(); from benchmarks.parts.audit.database_side import main; main()"
TITLES = {
    "speechrecord": "Speech history",
    "motionrecord": "Motion history",
    "refusalrecord": "Refusals and gate",
    "record": "Everything",
    "controlsession": "Control sessions",
    "report": "Report of a robot",
}


def measure() -> list[Figure]:
    """All parts, or those that are asked for; each figure is told as it comes."""
    figures = []
    for part in os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split():
        for figure in PARTS[part]():
            progress(figure.beside_limit())
            figures.append(figure)
    return figures


def latency() -> Iterator[Figure]:
    """A driver with and without the log."""
    with tempfile.TemporaryDirectory(prefix="fleet-bench-") as directory:
        yield from recording_cost.latency(Path(directory))


def on_sqlite() -> Iterator[Figure]:
    """A log in a file."""
    with sqlite() as environment:
        yield from _of_a_log("SQLite", environment)


def on_postgresql() -> Iterator[Figure]:
    """A log on a server, where one is installed."""
    if not postgresql_installed():
        progress("PostgreSQL is not installed")
        return
    with own_postgresql() as environment:
        yield from _of_a_log("PostgreSQL", environment)


PARTS = {"latency": latency, "sqlite": on_sqlite, "postgresql": on_postgresql}


def _of_a_log(database: str, environment: dict[str, str]) -> Iterator[Figure]:
    for figure in chain(writing(environment, 0), reading(environment), writing(environment, max(COUNTS))):
        yield Figure(f"{database}: {figure.name}", figure.value, figure.unit, figure.limit)


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


def writing(environment: dict[str, str], count: int) -> Iterator[Figure]:
    """Records per second, committed, into a log that has so many already."""
    progress("writing ...")
    yield Figure(f"{count:,} records: written by one process", _written(environment, 1), "/s")
    yield Figure(f"{count:,} records: written by {WRITERS} processes", _written(environment, WRITERS), "/s")


def reading(environment: dict[str, str]) -> Iterator[Figure]:
    """Pages, verification and export, as the log grows."""
    progress("filling and reading ...")
    slowest: dict[str, tuple[float, str]] = {}
    for told in _told(_start(environment, "reading", *map(str, COUNTS))):
        if "page" in told:
            slowest[told["page"]] = max(slowest.get(told["page"], (0.0, "")), (told["ms"], told["query"]))
        elif "verified_s" in told:
            yield from _of_pages(told["count"], slowest)
            yield from _of_verification(told)
            slowest = {}
        elif "filled_s" in told:
            progress(f"{told['count']:,} records: filled in {told['filled_s']:.0f} s")
        else:
            yield from _of_export(told)


def _of_pages(count: int, slowest: dict[str, tuple[float, str]]) -> Iterator[Figure]:
    for page, (ms, query) in slowest.items():
        progress(f"{count:,} records, {TITLES[page]}: slowest with {query or 'nothing'!r}")
        yield Figure(f"{count:,} records: {TITLES[page]}, slowest page", ms, "ms", PAGE_MS)


def _of_verification(told: dict[str, Any]) -> list[Figure]:
    count = told["count"]
    limit = VERIFIED_S if count <= VERIFIED_COUNT else None
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
