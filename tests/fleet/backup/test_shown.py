"""Staff and Prometheus see the last backup."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from django.test import Client
from django.urls import reverse
from prometheus_client import CollectorRegistry, generate_latest

from fleet.accounts.models import User
from fleet.audit.services import record
from teleop.api.backup_metrics import BackupCollector

ARCHIVE = {"archive": "fleet-lab1-2026-11-30T031500Z.tar.gz", "bytes": 2_000_000}


@pytest.fixture
def page(staff: User, signed_in: Callable[[User], Client]) -> Callable[[], str]:
    return lambda: signed_in(staff).get(reverse("admin:index")).content.decode()


def figures() -> str:
    registry = CollectorRegistry(auto_describe=False)
    registry.register(BackupCollector())
    return generate_latest(registry).decode()


def test_without_a_backup_the_page_says_so(page: Callable[[], str]) -> None:
    assert "There is no backup of this console yet." in page()
    assert "\nfleet_last_backup_timestamp_seconds " not in figures()


def test_the_last_backup_and_its_check_are_shown(page: Callable[[], str]) -> None:
    record("backup.make", outcome="done", parameters={"archive": "older", "bytes": 1})
    made = record("backup.make", outcome="done", parameters=ARCHIVE)
    assert ARCHIVE["archive"] in page()
    assert "No backup was checked yet." in page()
    record("backup.check", outcome="done")
    assert "Last check that one can be restored" in page()
    assert "failed" not in page()
    lines = dict(line.rsplit(" ", 1) for line in figures().splitlines() if not line.startswith("#"))
    assert float(lines["fleet_last_backup_timestamp_seconds"]) == pytest.approx(made.at.timestamp())
    assert "fleet_last_backup_check_timestamp_seconds" in lines


def test_a_try_that_failed_is_shown_beside_the_last_backup(page: Callable[[], str]) -> None:
    record("backup.make", outcome="done", parameters=ARCHIVE)
    record("backup.make", outcome="failed")
    assert "The last try failed" in page()
    assert ARCHIVE["archive"] in page()
