"""The audit log: its cost for a driver, records per second, lists and verification with a million records.

FLEET_BENCH_PARTS names the parts to run: latency, sqlite, postgresql. FLEET_BENCH_COUNTS: numbers of records.
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

from benchmarks.audit import log_cost
from benchmarks.harness import Figure, progress
from script.stack.places import REPOSITORY
from tests.script.servers import postgresql, postgresql_installed

COUNTS = [int(count) for count in os.environ.get("FLEET_BENCH_COUNTS", "100000 1000000").split()]
PAGE_MS = 300.0  # the slowest page of a list, with any filter
VERIFIED_S = 10.0
VERIFIED_COUNT = 100_000  # largest log to which this limit applies
WRITTEN_S = 5.0
WRITERS = 4  # processes: two web processes and two bridges
GROWN_MB = 50.0  # growth of memory during an export of everything
SIDE = "import django; django.setup(); from benchmarks.audit.database_side import main; main()"
TITLES = {
    "speechrecord": "Speech history",
    "motionrecord": "Motion history",
    "refusalrecord": "Refusals and gate",
    "record": "Everything",
    "controlsession": "Control sessions",
    "report": "Report of a robot",
}


def measure() -> list[Figure]:
    """Run all parts, or those of FLEET_BENCH_PARTS; print each figure as it comes."""
    figures = []
    for part in os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split():
        for figure in PARTS[part]():
            progress(figure.beside_limit())
            figures.append(figure)
    return figures


def latency() -> Iterator[Figure]:
    """Measure a driver's commands with and without the log."""
    with tempfile.TemporaryDirectory(prefix="fleet-bench-") as directory:
        yield from log_cost.latency(Path(directory))


def on_sqlite() -> Iterator[Figure]:
    """Measure a log in a file."""
    with sqlite() as environment:
        yield from _of_a_log("SQLite", environment)


def on_postgresql() -> Iterator[Figure]:
    """Measure a log on a server, if one is installed."""
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
    """Context: the environment of a process with an empty log in a file."""
    with tempfile.TemporaryDirectory(prefix="fleet-bench-") as directory:
        environment = _environment(directory)
        _migrate(environment)
        yield environment


@contextmanager
def own_postgresql() -> Iterator[dict[str, str]]:
    """Context: the environment of a process with an empty log on a server.

    The server writes every commit to the disk, as in production.
    """
    with ExitStack() as stack:
        url = stack.enter_context(postgresql(durable=True))
        directory = stack.enter_context(tempfile.TemporaryDirectory(prefix="fleet-bench-"))
        environment = {**_environment(directory), "FLEET_DATABASE_URL": url}
        _migrate(environment)
        yield environment


def writing(environment: dict[str, str], count: int) -> Iterator[Figure]:
    """Measure committed records per second into a log that already has this many."""
    progress("writing ...")
    yield Figure(f"{count:,} records: written by one process", _written(environment, 1), "/s")
    yield Figure(f"{count:,} records: written by {WRITERS} processes", _written(environment, WRITERS), "/s")


def reading(environment: dict[str, str]) -> Iterator[Figure]:
    """Measure pages, verification and export, as the log grows."""
    progress("filling and reading ...")
    slowest: dict[str, tuple[float, str]] = {}
    for result in _results(_start(environment, "reading", *map(str, COUNTS))):
        if "page" in result:
            page, duration = result["page"], (result["ms"], result["query"])
            slowest[page] = max(slowest.get(page, (0.0, "")), duration)
        elif "verified_s" in result:
            yield from _of_pages(result["count"], slowest)
            yield from _of_verification(result)
            slowest = {}
        elif "filled_s" in result:
            progress(f"{result['count']:,} records: filled in {result['filled_s']:.0f} s")
        else:
            yield from _of_export(result)


def _of_pages(count: int, slowest: dict[str, tuple[float, str]]) -> Iterator[Figure]:
    for page, (ms, query) in slowest.items():
        progress(f"{count:,} records, {TITLES[page]}: slowest with {query or 'nothing'!r}")
        yield Figure(f"{count:,} records: {TITLES[page]}, slowest page", ms, "ms", PAGE_MS)


def _of_verification(result: dict[str, Any]) -> list[Figure]:
    count = result["count"]
    limit = VERIFIED_S if count <= VERIFIED_COUNT else None
    return [
        Figure(f"{count:,} records: verified", result["verified_s"], "s", limit),
        Figure(f"{count:,} records: findings", result["findings"], "", 0.0),
    ]


def _of_export(result: dict[str, Any]) -> list[Figure]:
    return [
        Figure(f"{result['count']:,} records: exported", result["exported_s"], "s"),
        Figure(f"{result['count']:,} records: export is", result["mb"], "MB"),
        Figure(f"{result['count']:,} records: export takes memory", result["grown_mb"], "MB", GROWN_MB),
    ]


def _written(environment: dict[str, str], processes: int) -> float:
    """Return how many records all processes together commit in one second."""
    writers = [_start(environment, "writing", str(WRITTEN_S)) for _ in range(processes)]
    for writer in writers:
        if writer.stdin:
            writer.stdin.close()
    return float(sum(result["per_s"] for writer in writers for result in _results(writer)))


def _start(environment: dict[str, str], *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603 - our own command
        [sys.executable, "-c", SIDE, *words],
        cwd=REPOSITORY,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _results(process: subprocess.Popen[str]) -> Iterator[dict[str, Any]]:
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
