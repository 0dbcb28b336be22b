"""Run a fleet supervisor of many robots, and measure it. Its programs only wait for their end."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

from django.db import connection
from django.test.utils import CaptureQueriesContext

from robots.registry.models import BridgeStatus, Robot, RobotProfile
from robots.supervisor.fleet_supervisor import POLL_S, STEP_S, Fleet

WAITS = "import sys; sys.stdin.read()"


def main() -> None:
    """Measure for as many robots and seconds as the command line says; print JSON."""
    robots, seconds = int(sys.argv[1]), float(sys.argv[2])
    profile = RobotProfile.objects.get(slug="tiago")
    for n in range(robots):
        Robot.objects.create(
            slug=f"robot-{n}", name=f"Robot {n}", profile=profile, master_uri="http://127.0.0.1:9"
        )
    with tempfile.TemporaryDirectory() as directory:
        program = Path(directory) / "program.py"
        program.write_text(WAITS)
        fleet = Fleet(frozenset(), program, ("-c", WAITS), ("-c", WAITS))
        while BridgeStatus.objects.filter(state="running").count() < robots:
            run(fleet, 1.0)
        began_s = time.process_time()
        run(fleet, seconds)
        percent = 100.0 * (time.process_time() - began_s) / seconds
        with CaptureQueriesContext(connection) as queries:
            run(fleet, 2.5 * POLL_S)
        print(json.dumps({"percent": percent, "queries": len(queries) / 3}))
        fleet.end_programs()


def run(fleet: Fleet, seconds: float) -> None:
    """Run rounds as the supervisor does."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        fleet.step(time.monotonic())
        time.sleep(STEP_S)
