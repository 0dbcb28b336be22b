"""The fleet supervisor with many robots, when nothing changes: processor time and queries."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.growth.console import SECONDS
from benchmarks.harness import Figure
from script.stack.database import with_tables
from script.stack.places import REPOSITORY, kept_secret

ROBOTS = 20
SIDE = "import django; django.setup(); from benchmarks.growth.supervisor_side import main; main()"


def cost() -> Iterator[Figure]:
    """Measure a supervisor whose bridges and watchdogs are programs that do nothing."""
    with tempfile.TemporaryDirectory(prefix="fleet-growth-") as directory:
        with_tables(Path(directory))
        environment = {
            "DJANGO_SETTINGS_MODULE": "fleet.settings",
            "FLEET_VAR": directory,
            "FLEET_SECRET_KEY": kept_secret(Path(directory) / "secret-key"),
            "FLEET_HOSTS": "localhost",
        }
        words = [sys.executable, "-c", SIDE, str(ROBOTS), str(SECONDS)]
        run = subprocess.run(  # noqa: S603 - our own command
            words, cwd=REPOSITORY, env=environment, check=True, stdout=subprocess.PIPE
        )
    found = json.loads(run.stdout.splitlines()[-1])
    yield Figure(f"supervisor, {ROBOTS} robots: of a core", found["percent"], "%", 0.5)
    yield Figure(f"supervisor, {ROBOTS} robots: queries of a poll", found["queries"], "", 1.0)
