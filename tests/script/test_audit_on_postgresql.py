"""The tests of the audit log, once more over PostgreSQL: its triggers, locks and JSON are others than SQLite's."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.script.servers import postgresql
from tests.script.support import outside

ROOT = Path(__file__).parents[2]
TESTS = [
    "tests/accounts/test_erase_person.py",
    "tests/robots/test_faults.py",
    "tests/teleop/test_lease.py",
    "tests/teleop/test_reports.py",
    *(
        f"tests/audit/test_{name}.py"
        for name in (
            *("append_only", "chain", "exports", "kinds", "lists", "migration", "past", "record"),
            *("retention", "search", "triggers", "verify"),
        )
    ),
]


@pytest.mark.timeout(400)  # hundreds of tests
def test_what_holds_on_sqlite_holds_on_postgresql() -> None:
    command = [sys.executable, "-m", "pytest", "-q", *TESTS]
    environment = {name: value for name, value in outside().items() if not name.startswith("PYTEST")}
    with postgresql() as url:
        ran = subprocess.run(
            command, cwd=ROOT, env=environment | {"FLEET_DATABASE_URL": url}, capture_output=True, text=True
        )
    assert ran.returncode == 0, ran.stdout[-5000:] + ran.stderr[-2000:]
