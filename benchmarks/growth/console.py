"""A console without robots: web process, stand-ins for the bridges, people who are signed in."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from script.stack.database import with_tables
from script.stack.processes import Child
from script.stack.stack import PracticeRobot, Stack

SECONDS = float(os.environ.get("FLEET_BENCH_SECONDS", "20"))  # of each measurement of processor time
PEOPLE_SIDE = "import django; django.setup(); from benchmarks.growth.people_side import main; main()"


class Console(Stack):
    """A web process and its pages process. `cookies`: Cookie headers of as many people who may see each robot."""

    def __init__(self, directory: Path, robots: int, people: int) -> None:
        plans = [
            PracticeRobot(f"robot-{n}", f"Robot {n}", (0.0, 0.0, 0.0), is_on=False) for n in range(robots)
        ]
        super().__init__(directory, robots=plans)
        self._people = people
        self.cookies: list[str] = []

    def _seed(self) -> None:
        super()._seed()
        environment = {**self.environment, "DJANGO_SETTINGS_MODULE": "fleet.settings"}
        side = self.start_child("people", [sys.executable, "-c", PEOPLE_SIDE, str(self._people)], environment)
        self._finish(side)
        made = json.loads(side.last_lines().splitlines()[-1])
        self.cookies, self._keys = made["cookies"], made["robots"]

    def start_supervisor(self) -> Child:
        """Start the stand-ins of the bridges instead of the supervisor."""
        links = {robot.link_path: self._keys[slug] for slug, robot in self.robots.items()}
        words = [sys.executable, "-m", "benchmarks.growth.bridges_side", json.dumps(links)]
        self.supervisor = self.start_child("bridges", words, self.environment)
        return self.supervisor


@contextmanager
def console(robots: int, people: int) -> Iterator[Console]:
    """Context: a running console in a temporary directory."""
    with tempfile.TemporaryDirectory(prefix="fleet-growth-") as directory:
        with_tables(Path(directory))
        running = Console(Path(directory), robots, people)
        with running:
            yield running
