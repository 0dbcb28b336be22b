"""The database itself keeps the audit log append-only."""

import os
import re
import uuid
from pathlib import Path

import pytest
from django.db import DatabaseError, connection, transaction

from fleet.audit.errors import AppendOnly
from fleet.audit.models import Actor, Chain, Content, Record
from fleet.audit.services import actor_renamed, record
from tests.audit.support import refused_by_the_database

pytestmark = pytest.mark.django_db

APP = f"fleet_app_{os.getpid()}"  # PostgreSQL roles are shared by all databases of a server


def test_a_saved_record_cannot_be_saved_again():
    entry = record("stop.press")
    entry.kind = "stop.clear"
    with pytest.raises(AppendOnly):
        entry.save()


def test_a_record_cannot_be_deleted():
    with pytest.raises(AppendOnly):
        record("stop.press").delete()


def test_a_query_can_neither_update_nor_delete():
    record("stop.press")
    with pytest.raises(AppendOnly):
        Record.objects.all().update(kind="stop.clear")
    with pytest.raises(AppendOnly):
        Record.objects.filter(kind="stop.press").delete()
    with pytest.raises(AppendOnly):
        Record.objects.bulk_update(Record.objects.all(), ["kind"])


def test_a_new_object_with_an_old_number_replaces_no_record():
    entry = record("stop.press")
    with pytest.raises(DatabaseError), transaction.atomic():
        Record(pk=entry.pk, kind="stop.clear", day=entry.day, seq=99).save()
    assert Record.objects.get(pk=entry.pk).kind == "stop.press"


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE audit_record SET kind = 'stop.clear'",
        "UPDATE audit_record SET id = id + 1000",
        "UPDATE audit_record SET kind = kind",
        "DELETE FROM audit_record",
        "DELETE FROM audit_record WHERE seq = 1",
        "UPDATE audit_content SET text = 'something else'",
        "UPDATE audit_content SET data = '{}'",
        "DELETE FROM audit_actor",
        "UPDATE audit_actor SET id = 'somebody else'",
        "DELETE FROM audit_chain",
        "UPDATE audit_chain SET id = '7b0c1d9e000040008000000000000001'",
    ],
)
def test_raw_sql_is_refused_by_the_database_itself(statement, operator):
    entry = record("speech.start", actor=operator, text="Hello.", private={"figure": 1})
    assert "is append-only" in refused_by_the_database(statement)
    again = Record.objects.get(pk=entry.pk)
    assert (again.kind, again.actor_id, again.details) == (
        "speech.start",
        str(operator.pk),
        {"text": "Hello.", "figure": 1},
    )


def test_an_actor_and_a_chain_have_the_name_of_now(operator):
    record("stop.press", actor=operator, robot_id=uuid.UUID(int=1), robot_name="TIAGo 1")
    record("stop.press", robot_id=uuid.UUID(int=1), robot_name="TIAGo, the first")
    Actor.objects.filter(pk=str(operator.pk)).update(name="Olga Other")
    assert Chain.objects.get(pk=uuid.UUID(int=1)).name == "TIAGo, the first"
    assert Record.objects.filter(kind="stop.press").first().robot_name == "TIAGo, the first"
    assert Record.objects.filter(kind="stop.press").last().robot_name == "TIAGo 1"


def test_an_erased_actor_stays_erased(operator):
    record("stop.press", actor=operator)
    Actor.objects.filter(pk=str(operator.pk)).update(name="Person 7f3a", erased_at="2026-01-01T00:00:00Z")
    assert "is append-only" in refused_by_the_database(
        "UPDATE audit_actor SET name = 'Olga', erased_at = NULL"
    )


def test_content_may_be_taken_out_and_its_words_with_it():
    entry = record("speech.start", text="Hello.")
    Content.objects.filter(pk=entry.pk).delete()
    assert Record.objects.get(pk=entry.pk).details == {}


@pytest.mark.skipif(connection.vendor != "sqlite", reason="only SQLite has INSERT OR REPLACE")
@pytest.mark.parametrize(
    "statement",
    [
        "INSERT OR REPLACE INTO audit_record SELECT * FROM audit_record",
        "INSERT OR REPLACE INTO audit_content SELECT * FROM audit_content",
        "INSERT OR REPLACE INTO audit_actor SELECT * FROM audit_actor",
        "REPLACE INTO audit_record ({0}, id) SELECT {0}, id + 1000 FROM audit_record WHERE robot_id NOT NULL",
        "REPLACE INTO audit_record ({0}, id) SELECT {0}, id + 1000 FROM audit_record WHERE robot_id IS NULL",
    ],
)
def test_insert_or_replace_is_refused(statement, operator):
    record("speech.start", actor=operator, robot_id=uuid.UUID(int=1), text="Hello.")
    columns = ", ".join(field.column for field in Record._meta.fields if field.column != "id")
    assert "is append-only" in refused_by_the_database(statement.format(columns))


@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite has no TRUNCATE")
@pytest.mark.parametrize("table", ["audit_record", "audit_content", "audit_actor", "audit_chain"])
def test_truncate_is_refused(table):
    record("stop.press")
    assert "is append-only" in refused_by_the_database(f"TRUNCATE {table} CASCADE")


@pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite has no roles")
def test_the_documented_database_rights_are_enough(operator):
    """Runs the statements of docs/deployment.md."""
    notes = (Path(__file__).parents[3] / "docs/deployment.md").read_text()
    grants = re.findall(r"^    ((?:REVOKE|GRANT) .* audit_.*;)$", notes, re.MULTILINE)
    assert len(grants) >= 5
    with connection.cursor() as cursor:
        cursor.execute(f"CREATE ROLE {APP}; GRANT USAGE ON SCHEMA public TO {APP}")
        for grant in grants:
            cursor.execute(grant.replace("fleet_app", APP))
        cursor.execute(f"SET LOCAL ROLE {APP}")
    old = record(
        "speech.start", actor=operator, robot_id=uuid.UUID(int=1), robot_name="TIAGo 1", text="Hello."
    )
    record("speech.end", of=old, robot_name="TIAGo, the first")
    actor_renamed(operator)
    Content.objects.filter(pk=old.pk).delete()
    for statement in (
        "UPDATE audit_record SET kind = 'stop.press'",
        "DELETE FROM audit_record",
        "TRUNCATE audit_record",
        "UPDATE audit_content SET text = ''",
        "DELETE FROM audit_actor",
        "DELETE FROM audit_chain",
        "DROP TRIGGER audit_record_no_update ON audit_record",
        "ALTER TABLE audit_record DISABLE TRIGGER ALL",
    ):
        said = refused_by_the_database(statement)
        assert "permission denied" in said or "must be owner" in said, (statement, said)


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("time", ["first", "second"])
def test_a_rebuilt_test_database_has_its_triggers(time):
    assert not Record.objects.filter(kind="stop.press").exists()
    record("stop.press")
    assert "is append-only" in refused_by_the_database("DELETE FROM audit_record")
