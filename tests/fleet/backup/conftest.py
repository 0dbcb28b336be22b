"""A console of its own: a database in its own folder, with a person and a record."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from django.db import connection

from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.backup.archive import age
from tests.fleet.backup.support import new_console


@pytest.fixture
def console(
    transactional_db: None, tmp_path: Path, settings: object, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Path]:
    """The folder FLEET_VAR of a console."""
    if connection.vendor != "sqlite":
        pytest.skip("tests/script/test_backup.py has PostgreSQL")
    monkeypatch.setattr(age, "WORK", 4)
    with new_console(tmp_path / "var", settings) as var:
        User.objects.create_user("ada", full_name="Ada")
        record("speech.start", robot_id=uuid.uuid4(), robot_name="TIAGo 1", text="Hello.")
        yield var
