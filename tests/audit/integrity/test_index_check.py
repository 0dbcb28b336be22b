"""The index check finds a search index that does not match the log's texts, and hidden changes to both."""

import pytest
from django.db import connection

from fleet.audit.integrity import index_check
from fleet.audit.integrity.verify import verify_all
from fleet.audit.models import Content
from fleet.audit.services import record
from tests.audit.support import index_anew, tamper

pytestmark = pytest.mark.django_db

sqlite_only = pytest.mark.skipif(connection.vendor != "sqlite", reason="PostgreSQL writes its index itself")
postgresql_only = pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite has no such thing")
TEXTS = ["good morning", "good evening", "", "你好", "¿Cómo estás, mañana?", "x" * 2500]


@pytest.fixture(autouse=True)
def texts():
    """Write records with these texts."""
    return [record("speech.start", text=text).pk for text in TEXTS]


def execute(statement, *values):
    with connection.cursor() as cursor:
        cursor.execute(statement, values or None)


def findings():
    return [str(finding) for finding in verify_all().findings]


def test_as_it_was_written_index_and_log_agree(monkeypatch):
    monkeypatch.setattr(index_check, "BATCH_SIZE", 2)  # several batches
    assert findings() == []
    Content.objects.filter(text="good evening").delete()  # as when it expires
    assert list(index_check.disagreements()) == []
    index_anew()
    assert list(index_check.disagreements()) == []


@sqlite_only
def test_an_index_that_was_emptied_is_found():
    execute("INSERT INTO audit_content_search (audit_content_search) VALUES ('delete-all')")
    assert findings() == ["database: the search index is empty."]


@sqlite_only
@pytest.mark.parametrize("instead", ["", "evening good"])
def test_a_text_removed_or_replaced_in_the_index_is_found(texts, instead):
    out = "INSERT INTO audit_content_search (audit_content_search, rowid, text) VALUES ('delete', %s, %s)"
    execute(out, texts[0], TEXTS[0])
    if instead:
        execute("INSERT INTO audit_content_search (rowid, text) VALUES (%s, %s)", texts[0], instead)
    [finding] = findings()
    assert finding.startswith("database: the search index does not agree with the log: ")


@sqlite_only
def test_two_texts_that_changed_places_in_the_index_are_found(texts):
    for number, text in ((0, TEXTS[0]), (1, TEXTS[1])):
        execute(
            "INSERT INTO audit_content_search (audit_content_search, rowid, text) VALUES ('delete', %s, %s)",
            texts[number],
            text,
        )
        execute("INSERT INTO audit_content_search (rowid, text) VALUES (%s, %s)", texts[1 - number], text)
    assert len(findings()) == 1


@sqlite_only
def test_an_index_of_another_make_is_found():
    execute("DROP TABLE audit_content_search")
    assert findings() == ["database: the index audit_content_search is missing."]
    execute("CREATE TABLE audit_content_search (text)")
    assert findings() == ["database: the index audit_content_search differs from the console’s own index."]


@pytest.mark.parametrize(
    "instead", ["", "CREATE INDEX audit_content_said ON audit_content (record_id) WHERE text = 'x'"]
)
def test_a_missing_or_partial_short_word_index_is_found(instead):
    if connection.vendor == "postgresql":
        execute("SET CONSTRAINTS ALL IMMEDIATE")  # otherwise PostgreSQL creates no index in this transaction
    execute("DROP INDEX audit_content_said")
    if instead:
        execute(instead)
    what = "differs from the console’s own index" if instead else "is missing"
    assert findings() == [f"database: the index audit_content_said {what}."]


@postgresql_only
def test_an_index_that_is_not_in_force_is_found():
    execute("UPDATE pg_index SET indisvalid = false WHERE indexrelid = 'audit_content_trigrams'::regclass")
    assert findings() == ["database: the index audit_content_trigrams is missing."]


@postgresql_only
def test_texts_missing_in_the_index_are_found():
    ready = (
        "UPDATE pg_index SET indisready = {0}, indisvalid = {0}"
        " WHERE indexrelid = 'audit_content_trigrams'::regclass"
    )
    execute(ready.format("false"))
    record("speech.start", text="not indexed")
    execute(ready.format("true"))
    assert len(findings()) == 1


@sqlite_only
@pytest.mark.parametrize("name", ["audit_content_index", "audit_content_unindex"])
def test_a_search_trigger_that_is_gone_or_replaced_is_found(name):
    execute(f"DROP TRIGGER {name}")
    assert findings() == [f"database: the trigger {name} is missing."]
    execute(f"CREATE TRIGGER {name} AFTER INSERT ON audit_content WHEN 0 BEGIN SELECT 1; END")
    assert findings() == [f"database: the trigger {name} differs from the console’s own trigger."]


@pytest.mark.parametrize(
    "harm",
    [
        "DELETE FROM audit_content WHERE text LIKE 'good%'",
        "DELETE FROM audit_record",
        "UPDATE audit_content SET text = ''",
        "INSERT INTO audit_actor (id, name) VALUES ('x', 'x')",
    ],
)
@pytest.mark.parametrize("table", ["accounts_signin", "robots_robot", "django_session"])
def test_a_foreign_trigger_that_changes_the_log_is_found(table, harm):
    if table not in connection.introspection.table_names():
        table = "teleop_lease"
    if connection.vendor == "sqlite":
        execute(f"CREATE TRIGGER tidy AFTER INSERT ON {table} BEGIN {harm}; END")
    else:
        body = f"BEGIN {harm}; RETURN NULL; END"
        quoted = body.replace("'", "''")
        execute(f"CREATE FUNCTION tidy() RETURNS trigger LANGUAGE plpgsql AS '{quoted}'")
        execute(f"CREATE TRIGGER tidy AFTER INSERT ON {table} FOR EACH ROW EXECUTE FUNCTION tidy()")
    assert findings() == ["database: the trigger tidy is none that the console made."]


@postgresql_only
def test_a_rule_that_changes_the_log_is_found():
    execute("CREATE RULE tidy AS ON INSERT TO teleop_lease DO ALSO DELETE FROM audit_content")
    assert findings() == ["database: the trigger tidy is none that the console made."]


def test_a_text_that_was_changed_in_the_log_is_found_in_both(texts):
    tamper("UPDATE audit_content SET text = 'good night' WHERE record_id = %s", texts[0])
    found = findings()
    assert "has another content than was written." in found[0]
    assert len(found) == (2 if connection.vendor == "sqlite" else 1)  # PostgreSQL updates its index
