"""The content of a record, and the moment when it is written."""

import sqlite3
import uuid
from concurrent.futures import ThreadPoolExecutor

import pytest
from django.conf import settings
from django.db import OperationalError, connection, transaction

from fleet.audit.command_line import SystemAccount, here
from fleet.audit.errors import AuditUnavailable
from fleet.audit.integrity.canonical import TEXT_BYTES
from fleet.audit.integrity.verify import verify_all
from fleet.audit.kinds import KINDS, Kept
from fleet.audit.models import Record
from fleet.audit.services import record
from fleet.base import environment
from fleet.base.database.schema import SchemaRefused

ROBOT = uuid.uuid4()


@pytest.mark.django_db
def test_a_record_has_person_action_and_robot(operator):
    session, request = uuid.uuid4(), uuid.uuid4()
    record(
        "control.take",
        actor=operator,
        robot_id=ROBOT,
        robot_name="TIAGo 1",
        session_id=session,
        fence=7,
        request_id=request,
        outcome="granted",
        parameters={"seconds": 10.0},
    )
    entry = Record.objects.get(kind="control.take")
    assert (entry.actor_id, entry.actor_name) == (str(operator.pk), "Olga Operator")
    assert (entry.robot_id, entry.robot_name) == (ROBOT, "TIAGo 1")
    assert (entry.session_id, entry.fence, entry.request_id) == (session, 7, request)
    assert (entry.outcome, entry.parameters) == ("granted", {"seconds": 10.0})


@pytest.mark.django_db
def test_without_an_actor_it_was_the_console_itself():
    entry = record("control.expire", robot_id=ROBOT)
    assert (entry.actor_id, entry.actor_name) == (None, "")


@pytest.mark.django_db
def test_order_numbers_grow():
    assert record("stop.press").pk < record("stop.clear").pk


@pytest.mark.django_db
def test_every_record_is_its_own_request_unless_given_one():
    assert record("stop.press").request_id != record("stop.press").request_id


@pytest.mark.django_db
def test_an_outcome_belongs_to_its_request_and_robot():
    pressed = record("stop.press", robot_id=ROBOT, robot_name="TIAGo 1")
    outcome = record("stop.press", of=pressed, outcome="stopped")
    assert (outcome.of, outcome.request_id) == (pressed, pressed.request_id)
    assert (outcome.robot_id, outcome.robot_name) == (ROBOT, "TIAGo 1")


@pytest.mark.django_db
def test_an_outcome_may_name_its_request_by_number():
    pressed = record("stop.press")
    assert record("stop.press", of=pressed.pk, outcome="stopped").of == pressed


@pytest.mark.django_db
def test_an_outcome_inherits_values_of_its_request():
    session, other = uuid.uuid4(), uuid.uuid4()
    asked = record("motion.start", robot_id=ROBOT, robot_name="TIAGo 1", session_id=session, fence=7)
    for of in (asked, asked.pk):
        outcome = record("motion.end", of=of, outcome="done")
        assert (outcome.robot_id, outcome.robot_name) == (ROBOT, "TIAGo 1")
        assert (outcome.session_id, outcome.fence, outcome.request_id) == (session, 7, asked.request_id)
    ended = record("motion.end", of=asked, session_id=other, fence=0, request_id=other)
    assert (ended.session_id, ended.fence, ended.request_id) == (other, 0, other)


@pytest.mark.django_db
def test_an_outcome_of_nothing_is_an_error():
    with pytest.raises(ValueError, match="no record 999999"):
        record("motion.end", of=999_999)


@pytest.mark.django_db
def test_an_undescribed_kind_is_an_error():
    with pytest.raises(ValueError, match=r"'stop\.squeeze' is no kind of record"):
        record("stop.squeeze")


@pytest.mark.django_db
def test_texts_and_expiring_parts_are_kept_apart():
    entry = record(
        "speech.start",
        parameters={"language": "en-GB"},
        text="Hello.",
        private={"address": "10.0.0.7"},
    )
    again = Record.objects.get(pk=entry.pk)
    assert again.parameters == {"language": "en-GB"}
    assert again.details == {"language": "en-GB", "text": "Hello.", "address": "10.0.0.7"}
    assert (again.content.text, again.content.data) == ("Hello.", {"address": "10.0.0.7"})
    again.content.delete()
    assert Record.objects.get(pk=entry.pk).details == {"language": "en-GB"}


@pytest.mark.django_db
def test_a_record_without_text_and_details_has_no_content():
    entry = record("stop.press", parameters={"figure": 1})
    assert (entry.content_digest, entry.content_kept, entry.details) == ("", None, {"figure": 1})


@pytest.mark.django_db
def test_the_real_actor_is_named_if_different(operator, staff):
    entry = record("control.end", actor=operator, real_actor=staff)
    assert (entry.actor.name, entry.real_actor.name) == ("Olga Operator", "Sam Staff")


@pytest.mark.django_db
def test_a_person_at_the_command_line_is_an_actor_too():
    entry = record("stop.press", actor=SystemAccount("kim"))
    assert (entry.actor_id, entry.actor_name) == ("system:kim", "kim")
    assert here().name


@pytest.mark.django_db
def test_two_texts_that_are_equal_have_different_digests():
    assert (
        record("speech.start", text="No.").content_digest != record("speech.start", text="No.").content_digest
    )


@pytest.mark.django_db
def test_times_and_numbers_of_a_chain_grow_with_its_places():
    for _ in range(5):
        record("stop.press", robot_id=ROBOT)
    found = Record.objects.filter(robot_id=ROBOT).order_by("seq").values_list("id", "at")
    assert list(found) == sorted(found)


@pytest.mark.django_db
@pytest.mark.parametrize("letter", ["x", "ß", "न", "🤖"])
@pytest.mark.parametrize("left", range(4))
def test_a_long_text_keeps_its_begin_and_length(letter, left):
    long = left * "." + letter * 10_000
    entry = record("refusal", text=long, private={"words": [long]}, parameters={"figures": {"name": long}})
    kept = Record.objects.get(pk=entry.pk)
    said = f"… [cut: {len(long.encode())} bytes]"
    for text in (kept.details["text"], kept.details["words"][0], kept.parameters["figures"]["name"]):
        assert TEXT_BYTES - len(letter.encode()) < len(text.encode()) <= TEXT_BYTES
        assert text.endswith(said) and long.startswith(text.removesuffix(said))
    assert verify_all().findings == []


@pytest.mark.django_db
def test_a_text_that_is_just_short_enough_is_kept_as_it_is():
    text = "🤖" * (TEXT_BYTES // 4)
    assert Record.objects.get(pk=record("speech.start", text=text).pk).details == {"text": text}


@pytest.mark.django_db
@pytest.mark.parametrize("kept", Kept)
def test_every_class_of_retention_has_kinds_and_days(kept):
    assert any(kind.kept == kept for kind in KINDS.values())
    assert settings.FLEET_AUDIT_KEEP_DAYS[kept.value] > 0


@pytest.mark.django_db(transaction=True)
def test_a_record_is_committed_when_the_call_returns():
    entry = record("stop.press")
    assert _seen_by_another_connection() == [entry.pk]


@pytest.mark.django_db(transaction=True)
def test_inside_a_transaction_it_is_committed_with_it():
    with transaction.atomic():
        entry = record("stop.press")
        assert _seen_by_another_connection() == []
    assert _seen_by_another_connection() == [entry.pk]


@pytest.mark.django_db(transaction=True)
def test_a_rolled_back_action_is_not_recorded():
    with pytest.raises(ZeroDivisionError), transaction.atomic():
        record("control.take")
        raise ZeroDivisionError
    assert _seen_by_another_connection() == []


@pytest.mark.django_db(transaction=True)
def test_parallel_writers_wait_and_lose_nothing():
    def write(writer: int) -> None:
        for number in range(25):
            record("stop.press", parameters={"writer": writer, "number": number})
        connection.close()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(write, range(4)))
    written = Record.objects.order_by("id").values_list("parameters__writer", "parameters__number")
    for writer in range(4):
        assert [number for by, number in written if by == writer] == list(range(25))


def _seen_by_another_connection() -> list[int]:
    def look() -> list[int]:
        try:
            written = Record.objects.exclude(kind__in=["profile.create", "phrase.import"])  # of migrations
            return list(written.values_list("pk", flat=True))
        finally:
            connection.close()

    with ThreadPoolExecutor(1) as pool:
        return pool.submit(look).result()


@pytest.mark.skipif(connection.vendor != "sqlite", reason="locks the database file")
@pytest.mark.django_db(transaction=True)
def test_a_locked_database_is_a_refusal_in_words():
    with connection.cursor() as cursor:
        cursor.execute("PRAGMA busy_timeout = 50")
    other = sqlite3.connect(connection.settings_dict["NAME"])
    try:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(AuditUnavailable) as refused:
            record("control.take")
    finally:
        other.close()
        connection.close()
    assert (refused.value.code, refused.value.rule) == ("audit_locked", "audit")
    assert "could not be recorded" in refused.value.text


@pytest.mark.skipif(connection.vendor != "sqlite", reason="limits the database file")
@pytest.mark.django_db(transaction=True)
def test_a_full_disk_is_a_refusal_in_words():
    with connection.cursor() as cursor:
        cursor.execute("PRAGMA page_count")
        pages = cursor.fetchone()[0]
        cursor.execute(f"PRAGMA max_page_count = {pages}")
    try:
        with pytest.raises(AuditUnavailable) as refused:
            record("control.take", parameters={"much": "x" * 1_000_000})
    finally:
        connection.close()
    assert refused.value.code == "audit_disk_full"


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ("database is locked", "audit_locked"),
        ("canceling statement due to lock timeout", "audit_locked"),
        ("database or disk is full", "audit_disk_full"),
        ("could not extend file: No space left on device", "audit_disk_full"),
        ("attempt to write a readonly database", "audit_read_only"),
        ("cannot execute INSERT in a read-only transaction", "audit_read_only"),
        ("no such table: audit_record", "audit_no_table"),
        ("connection refused", "audit_unreachable"),
    ],
)
def test_each_trouble_has_its_code(said, code):
    assert AuditUnavailable.because(OperationalError(said)).code == code


def test_another_release_is_known_whatever_its_migrations_are_called():
    refused = SchemaRefused("It does not know its migrations bookings.0999_full_days.")
    assert AuditUnavailable.because(refused).code == "audit_other_release"


def test_the_database_keeps_commits_through_a_power_cut():
    file = environment.database("sqlite:////var/lib/fleet/fleet.sqlite3")
    server = environment.database("postgresql://fleet@localhost/fleet")
    assert "synchronous=FULL" in file["OPTIONS"]["init_command"]
    assert "synchronous_commit" not in server["OPTIONS"]["options"]
