"""What was recorded before there were chains is kept, and chained."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import datetime, timezone
from pathlib import Path
from unittest import mock

import pytest
from django.db import connection, connections
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.migrations.executor import MigrationExecutor

from fleet.audit import triggers
from fleet.audit.models import Actor, Chain, Record
from fleet.audit.retention import take_out
from fleet.audit.search import texts_with
from fleet.audit.verify import verify

ROBOT = uuid.UUID("7b0c1d9e-0000-4000-8000-000000000001")
AT = datetime(2026, 3, 1, 23, 30, tzinfo=timezone.utc)


@contextmanager
def empty_database(tmp_path: Path) -> Iterator[BaseDatabaseWrapper]:
    """The default connection, to a database in which nothing was migrated."""
    name = str(tmp_path / "old.sqlite3") if connection.vendor == "sqlite" else f"old_{uuid.uuid4().hex}"
    if connection.vendor == "postgresql":
        with connection._nodb_cursor() as cursor:
            cursor.execute(f"CREATE DATABASE {name}")
    other = connections["default"].copy()
    other.settings_dict["NAME"] = name
    try:
        with closing(other), mock.patch.object(connections._connections, "default", other):
            yield other
    finally:
        if connection.vendor == "postgresql":
            with connection._nodb_cursor() as cursor:
                cursor.execute(f"DROP DATABASE {name} WITH (FORCE)")


@pytest.mark.django_db(transaction=True)
def test_old_records_are_kept_and_chained(tmp_path):
    with empty_database(tmp_path) as database:
        old = MigrationExecutor(database).migrate([("audit", "0003_robot_kind")])
        Old = old.apps.get_model("audit", "Record")
        said = Old.objects.create(
            at=AT,
            kind="speech.start",
            actor_id="someone",
            actor_name="Some One",
            robot_id=ROBOT,
            robot_name="TIAGo 1",
            parameters={"text": "Hello.", "language": "en-GB", "rate": 1.0},
        )
        Old.objects.create(kind="stop.press", parameters={"reason": "smoke", "through": "page"})
        Old.objects.create(
            kind="speech.end", actor_id="someone", actor_name="Some One Else", robot_id=ROBOT, of=said
        )
        Old.objects.create(kind="drive.end", robot_id=ROBOT, outcome="stopped by Some One")
        MigrationExecutor(database).migrate([("audit", "0004_chain")])

        start, stop, end, drive = Record.objects.order_by("id")
        assert (start.at, start.day.isoformat(), start.actor_name) == (AT, "2026-03-01", "Some One Else")
        assert start.parameters == {"language": "en-GB", "rate": 1}
        assert start.details == {"text": "Hello.", "language": "en-GB", "rate": 1}
        assert (stop.parameters, stop.actor) == ({"through": "page"}, None)
        assert stop.details["reason"] == "smoke"
        assert (drive.outcome, drive.details) == ("halted", {"words": "stopped by Some One"})
        assert (end.of_id, start.seq, end.seq, stop.seq) == (start.pk, 1, 2, 1)
        assert list(Actor.objects.values_list("pk", "name")) == [("someone", "Some One Else")]
        assert set(Chain.objects.values_list("pk", "name")) == {(ROBOT, "TIAGo 1"), (uuid.UUID(int=0), "")}
        assert verify(Chain.objects.all()).findings == []
        assert triggers.amiss(connection) == {}
        assert sum(texts.count() for texts in texts_with(("Hello.",))) == 1
        for _step in take_out([start.pk]):
            pass
        assert not any(texts.exists() for texts in texts_with(("Hello.",)))
