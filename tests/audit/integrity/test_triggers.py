"""The check finds a trigger that refuses nothing, whatever its name."""

import pytest
from django.db import connection

from fleet.audit.integrity import triggers
from fleet.audit.integrity.verify import verify_all

pytestmark = pytest.mark.django_db

ANOTHER = "differs from the console’s own trigger"
OFF = "is switched off"

_SQLITE = {
    "CREATE TRIGGER {0} BEFORE UPDATE ON audit_record WHEN 0 BEGIN SELECT RAISE(ABORT, 'no'); END": ANOTHER,
    "CREATE TRIGGER {0} BEFORE UPDATE OF kind ON audit_record WHEN 1"
    " BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END": ANOTHER,
    "CREATE TRIGGER {0} BEFORE UPDATE ON audit_chain WHEN 1"
    " BEGIN SELECT RAISE(ABORT, 'audit_record is append-only'); END": ANOTHER,
}
_AS_MADE = "CREATE TRIGGER {0} BEFORE UPDATE ON audit_record FOR EACH ROW EXECUTE FUNCTION audit_refuse()"
_POSTGRESQL = {
    "CREATE TRIGGER {0} BEFORE UPDATE ON audit_record FOR EACH ROW WHEN (false)"
    " EXECUTE FUNCTION audit_refuse()": ANOTHER,
    "CREATE TRIGGER {0} BEFORE UPDATE OF kind ON audit_record FOR EACH ROW"
    " EXECUTE FUNCTION audit_refuse()": ANOTHER,
    "CREATE TRIGGER {0} AFTER UPDATE ON audit_record FOR EACH ROW EXECUTE FUNCTION audit_refuse()": ANOTHER,
    "CREATE TRIGGER {0} BEFORE UPDATE ON audit_chain FOR EACH ROW EXECUTE FUNCTION audit_refuse()": ANOTHER,
    "CREATE TRIGGER {0} BEFORE UPDATE ON audit_record FOR EACH ROW"
    " EXECUTE FUNCTION suppress_redundant_updates_trigger()": ANOTHER,
    f"{_AS_MADE}; ALTER TABLE audit_record DISABLE TRIGGER {{0}}": OFF,
    f"{_AS_MADE}; ALTER TABLE audit_record ENABLE REPLICA TRIGGER {{0}}": OFF,
}
NAME = "audit_record_no_update"


def execute(statement: str) -> None:
    with connection.cursor() as cursor:
        cursor.execute(statement)


def drop() -> None:
    execute(f"DROP TRIGGER {NAME}" + (" ON audit_record" if connection.vendor == "postgresql" else ""))


def findings() -> list[str]:
    return [str(finding) for finding in verify_all().findings]


def test_as_they_were_made_nothing_is_amiss():
    assert triggers.amiss(connection) == {}


def test_one_that_is_missing_is_named():
    drop()
    assert findings() == [f"database: the trigger {NAME} is missing."]


@pytest.mark.parametrize(
    ("statement", "wrong"), {"sqlite": _SQLITE, "postgresql": _POSTGRESQL}[connection.vendor].items()
)
def test_one_that_has_only_the_name_is_named(statement, wrong):
    drop()
    execute(statement.format(NAME))
    assert findings() == [f"database: the trigger {NAME} {wrong}."]


def test_one_that_was_put_in_is_named():
    """An example is a trigger that copies texts before they expire."""
    execute("CREATE TABLE elsewhere (text TEXT)")
    copy = "INSERT INTO elsewhere (text) VALUES (NEW.text)"
    if connection.vendor == "sqlite":
        execute(f"CREATE TRIGGER keep AFTER INSERT ON audit_content BEGIN {copy}; END")
    else:
        body = f"BEGIN {copy}; RETURN NULL; END"
        execute(f"CREATE FUNCTION keep() RETURNS trigger LANGUAGE plpgsql AS '{body}'")
        execute("CREATE TRIGGER keep AFTER INSERT ON audit_content FOR EACH ROW EXECUTE FUNCTION keep()")
    assert findings() == ["database: the trigger keep is none that the console made."]


@pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite's triggers have no functions")
@pytest.mark.parametrize(
    "change",
    [
        "CREATE OR REPLACE FUNCTION {0}() RETURNS trigger LANGUAGE plpgsql AS 'BEGIN RETURN NEW; END'",
        "ALTER FUNCTION {0}() SET search_path = elsewhere",
    ],
)
@pytest.mark.parametrize("function", ["audit_refuse", "audit_record_refuse_delete"])
def test_all_whose_function_does_something_else_are_named(function, change):
    execute(change.format(function))
    wrong = triggers.amiss(connection)
    assert set(wrong.values()) == {ANOTHER}
    assert ("audit_record_no_delete" in wrong) == (function == "audit_record_refuse_delete")
    assert ("audit_actor_no_update" in wrong) == (function == "audit_refuse")


@pytest.mark.skipif(connection.vendor != "postgresql", reason="of a condition as PostgreSQL writes it")
def test_a_condition_that_looks_at_less_is_named():
    execute("DROP TRIGGER audit_actor_no_update ON audit_actor")
    execute(
        "CREATE TRIGGER audit_actor_no_update BEFORE UPDATE ON audit_actor FOR EACH ROW"
        " WHEN (NEW.id::char(1) <> OLD.id::char(1) OR OLD.erased_at IS NOT NULL)"
        " EXECUTE FUNCTION audit_refuse()"
    )
    assert triggers.amiss(connection) == {"audit_actor_no_update": ANOTHER}
