"""Many people and many records as data: queries, time and size of the pages that show them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.audit import audit
from benchmarks.harness import Figure, progress
from script.stack.database import new_database
from script.stack.places import REPOSITORY

SIDE = "import django; django.setup(); from benchmarks.growth.data_side import main; main()"
# Of each page of `data_side`: most queries, most milliseconds of computing
LIMITS = {
    "robot in the admin, 600 roles": (30, 300.0),
    "robot groups, 2,000 people": (20, 200.0),
    "people of a group, 2,000 people": (20, 200.0),
    "course, 2,000 people": (20, 200.0),
    "next free hour, supervisor": (15, None),
    "next free hour, student": (15, None),
}
MILLION = "1000000"
VERIFIED_S = 40.0


def people() -> Iterator[Figure]:
    """Measure pages with many people."""
    with tempfile.TemporaryDirectory(prefix="fleet-growth-") as directory:
        new_database(Path(directory) / "fleet.sqlite3")
        own = {
            name: value for name, value in os.environ.items() if not name.startswith(("FLEET_", "DJANGO_"))
        }
        environment = {
            **own,
            "DJANGO_SETTINGS_MODULE": "fleet.settings",
            "FLEET_VAR": directory,
            "FLEET_DEBUG": "1",
            "FLEET_HOSTS": "testserver",
        }
        done = subprocess.run(  # noqa: S603 - our own command
            [sys.executable, "-c", SIDE],
            cwd=REPOSITORY,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
    for line in done.stdout.splitlines():
        found = json.loads(line)
        if (page := found["page"]) == "saved":
            yield Figure("robot in the admin, 600 roles: not saved", float(found["status"] != 302), "", 0.0)
            continue
        queries, computed_ms = LIMITS[page]
        yield Figure(f"{page}: queries", found["queries"], "", queries)
        yield Figure(f"{page}: computing", found["ms"], "ms", computed_ms)
        yield Figure(f"{page}: size", found["kB"], "kB")


def records() -> Iterator[Figure]:
    """Measure a log with a million records: lists with filters, verification, export. `script/bench audit` has more."""
    progress("a million records ...")
    audit.COUNTS[:] = [int(MILLION)]
    with audit.sqlite() as environment:
        for figure in audit.reading(environment):
            limit = VERIFIED_S if figure.name.endswith(": verified") else figure.limit
            yield Figure(figure.name, figure.value, figure.unit, limit)
