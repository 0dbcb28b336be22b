"""Chain digests are the same on every database, and parallel writers do not fork a chain."""

from __future__ import annotations

import os
import subprocess
import sys
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import quote

import pytest
from django.db import connection, transaction
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from fleet.accounts.models import User
from fleet.audit.errors import NotPlain
from fleet.audit.integrity.canonical import canonical, plain
from fleet.audit.integrity.verify import verify_all
from fleet.audit.models import Chain, Record
from fleet.audit.services import record

ROBOT = uuid.UUID("7b0c1d9e-0000-4000-8000-000000000001")
ROOT = Path(__file__).parents[3]
WRITER = """
import sys, uuid, django
django.setup()
from fleet.audit.errors import AuditUnavailable
from fleet.audit.services import record
robots = [uuid.UUID(word) if word != "none" else None for word in sys.argv[2:]]

def write(robot, number):
    try:
        record("stop.press", robot_id=robot, robot_name="TIAGo", parameters={"number": number})
    except AuditUnavailable as locked:  # whose turn it is, SQLite leaves to chance
        assert locked.code == "audit_locked", locked
        write(robot, number)

for number in range(int(sys.argv[1])):
    for robot in robots:
        write(robot, number)
"""

anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
many = hypothesis_settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


# --- the form ---------------------------------------------------------------------------------------


@pytest.mark.django_db
@many
@given(
    parameters=st.dictionaries(st.text(), anything, max_size=4), private=st.dictionaries(st.text(), anything)
)
def test_a_record_reads_back_as_it_was_chained(parameters, private):
    entry = record("stop.press", parameters=parameters, private=private)
    again = Record.objects.select_related("content").get(pk=entry.pk)
    assert canonical(again.parameters) == canonical(entry.parameters) == canonical(plain(parameters))
    assert canonical(again.content.data if private else {}) == canonical(plain(private))
    assert verify_all().findings == []


@pytest.mark.django_db
@many
@given(text=st.text(), name=st.text(), outcome=st.text(max_size=300))
def test_any_text_reads_back_as_it_was_chained(text, name, outcome):
    entry = record("speech.start", robot_id=ROBOT, robot_name=name, outcome=outcome, text=text)
    again = Record.objects.get(pk=entry.pk)
    assert (again.robot_name, again.outcome) == (entry.robot_name, entry.outcome)
    assert again.details.get("text", "") == text.replace("\0", "\ufffd")
    assert verify_all().findings == []


@given(value=anything)
def test_plain_values_stay_unchanged(value):
    assert canonical(plain(plain(value))) == canonical(plain(value))


@pytest.mark.parametrize(
    ("value", "form"),
    [
        (1.0, b"1"),
        (-0.0, b"0"),
        (1e22, b"10000000000000000000000"),
        (0.1, b"0.1"),
        ({"b": 1, "a": (True, None)}, b'{"a":[true,null],"b":1}'),
        ("é\0\ud800", '"é\ufffd\ufffd"'.encode()),
    ],
)
def test_numbers_and_characters_have_one_form(value, form):
    assert canonical(plain(value)) == form


@pytest.mark.parametrize("value", [float("nan"), float("inf"), object(), {1: "one"}, {"set"}, b"bytes"])
def test_values_that_are_no_json_are_refused(value):
    with pytest.raises(NotPlain):
        plain([value])


# --- writers ----------------------------------------------------------------------------------------


def places(robot_id: uuid.UUID | None) -> list[int]:
    return list(Record.objects.filter(robot_id=robot_id).order_by("id").values_list("seq", flat=True))


@pytest.mark.django_db(transaction=True)
def test_threads_that_write_at_once_fork_no_chain(operator: User, staff: User) -> None:
    """Also tests the first record of each chain and person: no row exists yet that can be locked."""
    robots = [None, ROBOT, uuid.UUID(int=2)]

    def write(writer: int) -> None:
        for number in range(15):
            with transaction.atomic():
                record(
                    "stop.press", actor=(operator, staff)[writer % 2], robot_id=robots[(writer + number) % 3]
                )
        connection.close()

    before = len(places(None))
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(write, range(4)))
    assert verify_all().findings == []
    assert len(places(None)) == before + 20
    assert places(ROBOT) == places(uuid.UUID(int=2)) == list(range(1, 21))


@pytest.mark.django_db(transaction=True)
def test_parallel_writers_fork_no_chain() -> None:
    """Bridges write about their own robot; web processes write about every robot and about none."""
    robots = [uuid.UUID(int=number) for number in range(1, 6)]
    bridges = [["20", str(robot)] for robot in robots]
    web = ["10", *map(str, robots), "none"]
    before = len(places(None))
    command = [sys.executable, "-c", WRITER]
    writers = [
        subprocess.Popen([*command, *words], env=_environment(), cwd=ROOT) for words in (*bridges, web, web)
    ]
    try:
        assert [writer.wait(60) for writer in writers] == [0] * 7
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
    assert verify_all().findings == []
    assert [places(robot) for robot in robots] == [list(range(1, 41))] * 5
    assert len(places(None)) == before + 20


def _environment() -> dict[str, str]:
    """Environment of a console process that uses the test database."""
    settings = connection.settings_dict
    if connection.vendor == "sqlite":
        url = f"sqlite:///{settings['NAME']}"
    else:
        person = quote(settings["USER"]) + (f":{quote(settings['PASSWORD'])}" if settings["PASSWORD"] else "")
        port = f":{settings['PORT']}" if settings["PORT"] else ""
        query = f"?host={settings['OPTIONS']['host']}" if "host" in settings["OPTIONS"] else ""
        url = f"postgresql://{person}@{settings['HOST']}{port}/{settings['NAME']}{query}"
    return os.environ | {"DJANGO_SETTINGS_MODULE": "fleet.settings", "FLEET_DATABASE_URL": url}


@pytest.mark.django_db(transaction=True)
def test_a_rolled_back_record_leaves_no_gap() -> None:
    record("stop.press", robot_id=ROBOT)
    with pytest.raises(ZeroDivisionError), transaction.atomic():
        record("stop.press", robot_id=ROBOT)
        raise ZeroDivisionError
    with transaction.atomic():
        with pytest.raises(ZeroDivisionError), transaction.atomic():
            record("stop.press", robot_id=ROBOT)
            raise ZeroDivisionError
        record("stop.clear", robot_id=ROBOT)
    assert places(ROBOT) == [1, 2]
    assert verify_all().findings == []


@pytest.mark.django_db
def test_each_robot_has_a_chain_and_so_has_the_rest() -> None:
    for robot_id in (ROBOT, uuid.UUID(int=2), ROBOT, None):
        record("stop.press", robot_id=robot_id, robot_name="TIAGo")
    assert places(ROBOT) == [1, 2]
    assert places(uuid.UUID(int=2)) == [1]
    assert {uuid.UUID(int=0), uuid.UUID(int=2), ROBOT} <= set(Chain.objects.values_list("pk", flat=True))


@pytest.mark.django_db
def test_a_record_costs_few_queries(operator: User, django_assert_num_queries) -> None:
    known = {"actor": operator, "robot_id": ROBOT, "robot_name": "TIAGo 1"}
    record("speech.start", text="Hello.", **known)
    with django_assert_num_queries(5):  # chain, people, previous record, number, insert
        record("drive.start", **known)
    with django_assert_num_queries(6):
        record("speech.start", text="Hello.", **known)
