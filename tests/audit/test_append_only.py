"""The audit table only ever grows."""

import pytest
from django.db import DatabaseError, connection, transaction

from fleet.audit import record
from fleet.audit.errors import AppendOnly
from fleet.audit.models import Record

pytestmark = pytest.mark.django_db


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


def test_a_new_object_with_a_known_number_does_not_replace_the_old_record():
    entry = record("stop.press")
    with pytest.raises(DatabaseError), transaction.atomic():
        Record(pk=entry.pk, kind="stop.clear").save()
    assert Record.objects.get(pk=entry.pk).kind == "stop.press"


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE audit_record SET kind = 'stop.clear'",
        "DELETE FROM audit_record",
        "UPDATE audit_record SET id = id + 1000",
    ],
)
def test_raw_sql_is_refused_by_the_database_itself(statement):
    entry = record("stop.press")
    with (
        pytest.raises(DatabaseError, match="append-only"),
        transaction.atomic(),
        connection.cursor() as cursor,
    ):
        cursor.execute(statement)
    assert Record.objects.get(kind="stop.press").pk == entry.pk


@pytest.mark.skipif(connection.vendor != "sqlite", reason="only SQLite has INSERT OR REPLACE")
def test_insert_or_replace_is_refused():
    entry = record("stop.press")
    with (
        pytest.raises(DatabaseError, match="append-only"),
        transaction.atomic(),
        connection.cursor() as cursor,
    ):
        cursor.execute(
            "INSERT OR REPLACE INTO audit_record SELECT * FROM audit_record WHERE id = %s", [entry.pk]
        )


@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite has no TRUNCATE")
def test_truncate_is_refused():
    record("stop.press")
    with (
        pytest.raises(DatabaseError, match="append-only"),
        transaction.atomic(),
        connection.cursor() as cursor,
    ):
        cursor.execute("TRUNCATE audit_record CASCADE")


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("time", ["first", "second"])
def test_the_triggers_are_there_again_after_a_test_database_was_emptied(time):
    assert not Record.objects.filter(kind="stop.press").exists()
    record("stop.press")
    with pytest.raises(DatabaseError, match="append-only"), connection.cursor() as cursor:
        cursor.execute("DELETE FROM audit_record")
