"""The audit tests on PostgreSQL: its triggers, locks and JSON differ from SQLite's."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import outside
from tests.script.servers import postgresql

ROOT = Path(__file__).parents[3]
TESTS = [
    "tests/accounts/test_erase_person.py",
    "tests/bookings/losses/test_under_the_lock.py",
    "tests/fleet/test_migration.py",
    "tests/robots/places/test_places.py",
    "tests/robots/supervisor/test_claims.py",
    "tests/robots/supervisor/test_faults.py",
    "tests/teleop/control/test_lease.py",
    "tests/teleop/reports/test_reports.py",
    *(
        f"tests/audit/{folder}test_{name}.py"
        for folder, names in (
            ("", ("invented_lab", "record", "retention")),
            ("integrity/", ("append_only", "chain", "index_check", "triggers", "verify")),
            ("reading/", ("exports", "lists", "search")),
        )
        for name in names
    ),
]


LIMITS = """
from django.db import connection
with connection.cursor() as cursor:
    for name in ("statement_timeout", "lock_timeout"):
        cursor.execute(f"SHOW {name}")
        print(cursor.fetchone()[0], end=" ")
"""
WEB, COMMAND = "import fleet.site.asgi", "import django; django.setup()"


def test_a_web_processes_query_is_limited_a_commands_is_not(tmp_path: Path) -> None:
    def limits(process: str, url: str) -> str:
        settings = {
            "FLEET_VAR": str(tmp_path / "var"),
            "FLEET_HOSTS": "localhost",
            "FLEET_SECRET_KEY": "k" * 32,
        }
        environment = (
            outside() | settings | {"DJANGO_SETTINGS_MODULE": "fleet.settings", "FLEET_DATABASE_URL": url}
        )
        command = [sys.executable, "-c", f"{process}\n{LIMITS}"]
        ran = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        return ran.stdout.strip()

    with postgresql() as url:
        assert (limits(WEB, url), limits(COMMAND, url)) == ("30s 5s", "0 5s")


@pytest.mark.timeout(400)  # hundreds of tests
def test_the_audit_tests_pass_on_postgresql() -> None:
    command = [sys.executable, "-m", "pytest", "-q", *TESTS]
    environment = {name: value for name, value in outside().items() if not name.startswith("PYTEST")}
    with postgresql() as url:
        ran = subprocess.run(
            command, cwd=ROOT, env=environment | {"FLEET_DATABASE_URL": url}, capture_output=True, text=True
        )
    assert ran.returncode == 0, ran.stdout[-5000:] + ran.stderr[-2000:]
