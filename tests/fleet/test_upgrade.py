"""`manage.py upgrade`: nothing is changed without a backup, nor while data would stop a migration."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing, nullcontext
from pathlib import Path
from unittest import mock

import pytest
from django.core.management import call_command
from django.core.management.base import CommandError, SystemCheckError
from django.db import OperationalError, connection
from django.db.migrations.recorder import MigrationRecorder

from fleet.accounts.models import User
from fleet.base.version import version
from fleet.site.management.commands import upgrade
from robots.shared.processes.one_supervisor import LOCK, only_instance

pytestmark = pytest.mark.django_db


@pytest.fixture
def migrate(tmp_path, settings, monkeypatch):
    """`migrate`, replaced; backups go into a folder of this test. tests/releases has PostgreSQL's locks."""
    monkeypatch.setattr(upgrade, "sole_upgrade", lambda _waits: nullcontext())
    monkeypatch.setattr(upgrade, "require_no_supervisor", lambda: None)
    settings.FLEET_VAR = tmp_path
    settings.FLEET_RUN_DIR = tmp_path / "run"
    settings.FLEET_RUN_DIR.mkdir()
    with mock.patch.object(upgrade, "call_command", autospec=True) as command:
        yield command


def unapply(app: str, name: str) -> None:
    MigrationRecorder(connection).record_unapplied(app, name)


def backups(folder: Path) -> list[Path]:
    return sorted((folder / "backups").glob("*"))


def test_a_database_of_this_release_needs_no_backup(migrate, tmp_path):
    call_command("upgrade")
    assert migrate.called  # it reads the profiles that came with the release
    assert not (tmp_path / "backups").exists()


@pytest.mark.skipif("connection.vendor != 'sqlite'")
def test_a_copy_is_made_before_sqlite_is_changed(migrate, tmp_path, capsys):
    unapply("bookings", "0019_lesson_tasks")
    call_command("upgrade")
    [copy] = backups(tmp_path)
    assert copy.name.startswith(f"before-{version()}-")
    assert str(copy) in capsys.readouterr().out
    with closing(sqlite3.connect(copy)) as kept:
        assert kept.execute("SELECT count(*) FROM robots_robotprofile").fetchone()[0] > 0
    assert migrate.called


@pytest.mark.skipif("connection.vendor != 'sqlite'")
def test_the_newest_copies_are_kept(migrate, tmp_path):
    unapply("bookings", "0019_lesson_tasks")
    (tmp_path / "backups").mkdir(mode=0o700)
    for number in range(upgrade.KEPT + 1):
        (tmp_path / f"backups/before-0.{number}-x.sqlite3").touch()
    call_command("upgrade")
    names = [copy.name for copy in backups(tmp_path)]
    assert len(names) == upgrade.KEPT
    assert any(name.startswith(f"before-{version()}") for name in names)


@pytest.mark.skipif("connection.vendor != 'sqlite'")
def test_the_first_copy_of_a_release_outlives_tries_that_fail(migrate, tmp_path):
    unapply("bookings", "0019_lesson_tasks")
    first = upgrade.back_up(tmp_path)
    os.utime(first, (1, 1))
    old = tmp_path / "backups/before-0.1-x.sqlite3"
    old.touch()
    os.utime(old, (2, 2))
    migrate.side_effect = CommandError("a migration fails")
    for try_ in range(upgrade.KEPT):
        copy = tmp_path / f"backups/before-{version()}-{try_}.sqlite3"
        with (
            mock.patch.object(upgrade, "back_up", lambda _, copy=copy: copy.touch()),
            pytest.raises(CommandError),
        ):
            call_command("upgrade")
    assert len(backups(tmp_path)) == upgrade.KEPT + 2  # nothing is removed before the upgrade is done
    migrate.side_effect = None
    call_command("upgrade")
    assert first in backups(tmp_path) and old not in backups(tmp_path)


def test_the_database_may_start_later_than_this_computer(migrate, monkeypatch, capsys):
    monkeypatch.setattr(connection, "vendor", "postgresql")
    monkeypatch.setattr(upgrade, "STEP_S", 0.0)
    away = OperationalError("connection refused\n")
    with mock.patch.object(connection, "ensure_connection", side_effect=[away, away, None, *[None] * 99]):
        call_command("upgrade", "--wait")
    assert migrate.called
    assert capsys.readouterr().err == "Waiting for the database, up to a minute: connection refused\n"
    monkeypatch.setattr(upgrade, "PATIENCE_S", -1.0)
    with (
        mock.patch.object(connection, "ensure_connection", side_effect=away),
        pytest.raises(OperationalError),
    ):
        call_command("upgrade", "--wait")


def test_nothing_is_changed_while_a_supervisor_runs(migrate, tmp_path, settings):
    unapply("bookings", "0019_lesson_tasks")
    with (
        only_instance(settings.FLEET_RUN_DIR / LOCK),
        pytest.raises(CommandError, match=r"a supervisor .* runs"),
    ):
        call_command("upgrade", "--migrate")
    assert (migrate.called, backups(tmp_path)) == (False, [])


def test_a_copy_that_fails_stops_the_upgrade(migrate, tmp_path, monkeypatch):
    unapply("bookings", "0019_lesson_tasks")
    monkeypatch.setattr(connection, "vendor", "sqlite")
    monkeypatch.setitem(connection.settings_dict, "NAME", str(tmp_path / "none.sqlite3"))
    with pytest.raises(CommandError, match="Nothing was changed: the database cannot be copied"):
        call_command("upgrade")
    assert (migrate.called, backups(tmp_path)) == (False, [])


def test_postgresql_waits_for_a_word(migrate, monkeypatch):
    unapply("bookings", "0019_lesson_tasks")
    monkeypatch.setattr(connection, "vendor", "postgresql")
    for key, value in {"HOST": "db.lab", "PORT": "5433", "USER": "fleet", "NAME": "console"}.items():
        monkeypatch.setitem(connection.settings_dict, key, value)
    with mock.patch.object(upgrade.Command, "check"), pytest.raises(CommandError) as refused:
        call_command("upgrade")
    line = f"pg_dump --format=custom --file=before-{version()}.dump --host=db.lab --port=5433 --username=fleet console"
    assert line in str(refused.value)
    assert "script/serve --migrate" in str(refused.value)
    assert not migrate.called
    with mock.patch.object(upgrade.Command, "check"):
        call_command("upgrade", "--migrate")
    assert migrate.called


def test_a_newer_database_is_not_touched(migrate, tmp_path):
    MigrationRecorder(connection).record_applied("bookings", "9999_later")
    with pytest.raises(CommandError, match=r"newer than this console .* bookings\.9999_later"):
        call_command("upgrade")
    assert (migrate.called, backups(tmp_path)) == (False, [])


@pytest.mark.parametrize(("command", "options"), [("upgrade", {}), ("migrate", {"skip_checks": False})])
def test_all_accounts_with_one_address_are_named_before(command, options, tmp_path, settings):
    settings.FLEET_VAR = tmp_path
    with connection.cursor() as cursor:
        cursor.execute("DROP INDEX one_account_per_email")
    unapply("accounts", "0003_one_account_per_email")
    for name, address in (
        ("ann", "a@x.org"),
        ("anna", "A@X.org"),
        ("bob", "b@x.org"),
        ("rob", "b@x.org"),
        ("cy", ""),
    ):
        User.objects.create_user(name)
        User.objects.filter(username=name).update(email=address)
    with pytest.raises(SystemCheckError) as refused:
        call_command(command, **options)
    assert "ann, anna have the same e-mail address, a@x.org" in str(refused.value)
    assert "bob, rob have the same e-mail address, b@x.org" in str(refused.value)
    assert User.objects.get(username="anna").email == "A@X.org"
    assert backups(tmp_path) == []
