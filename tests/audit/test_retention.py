"""Records expire after the time in the settings, and the remaining log still verifies."""

import io
import sqlite3
import time
import uuid
from contextlib import closing
from datetime import UTC, date, datetime, timedelta
from unittest import mock

import pytest
from django.core.management import call_command
from django.db import DatabaseError, connection, transaction
from django.utils import timezone as django_timezone

from fleet.audit import retention
from fleet.audit.integrity.verify import compare, verify_all
from fleet.audit.kinds import KINDS
from fleet.audit.models import Content, Record
from fleet.audit.retention import expire_contents, remove_old_records
from fleet.audit.services import record

pytestmark = pytest.mark.django_db

ROBOT = uuid.UUID("7b0c1d9e-0000-4000-8000-000000000001")
TODAY = date(2033, 6, 1)


@pytest.fixture
def ago():
    """`with ago(days)`: date records to that many days before `TODAY`."""

    def at(days: int):
        then = datetime(TODAY.year, TODAY.month, TODAY.day, 12, tzinfo=UTC) - timedelta(days=days)
        return mock.patch.object(django_timezone, "now", return_value=then)

    return at


@pytest.fixture(autouse=True)
def _nothing_but_what_the_test_records(ago, settings):
    """Set the clock to `TODAY`. The records of shipped profiles are dated before all days of these tests."""
    settings.FLEET_AUDIT_KEEP_RECORDS_DAYS = 20 * 365
    with ago(0):
        yield


@pytest.fixture
def five_years(settings):
    settings.FLEET_AUDIT_KEEP_RECORDS_DAYS = 1830


def exhaust(steps):
    return len(list(steps))


@pytest.mark.parametrize(
    ("kind", "days"), [("speech.start", 90), ("drive.end", 365), ("account.sign_in", 730), ("refusal", 365)]
)
def test_contents_go_when_the_days_of_their_class_are_over(kind, days, ago):
    with ago(days + 1):
        old = record(kind, robot_id=ROBOT, text="old", private={"figure": 1}, parameters={"stays": True})
    with ago(days):
        young = record(kind, robot_id=ROBOT, text="young")
    exhaust(expire_contents(TODAY))
    assert Record.objects.get(pk=old.pk).details == {"stays": True}
    assert Record.objects.get(pk=young.pk).details == {"text": "young"}
    assert verify_all().findings == []


def test_expiry_is_recorded_by_kind_day_and_number(ago):
    with ago(100):
        for text in "one", "two":
            record("speech.start", text=text)
    exhaust(expire_contents(TODAY))
    expiry = Record.objects.get(kind="audit.expire")
    assert expiry.parameters["kinds"]["speech.start"] == {"before": "2033-03-03", "removed": 2}


def test_a_second_expiry_has_nothing_to_do(ago):
    with ago(100):
        record("speech.start", text="old")
    exhaust(expire_contents(TODAY))
    exhaust(expire_contents(TODAY))
    assert Record.objects.filter(kind="audit.expire").count() == 1


@pytest.mark.parametrize("go", [expire_contents, remove_old_records])
def test_expired_texts_cannot_be_found(go, ago, five_years):
    with ago(2000):
        record("speech.start", text="Geheimnis")
    exhaust(go(TODAY))
    if connection.vendor == "sqlite":
        with connection.cursor() as cursor:
            cursor.execute("SELECT rowid FROM audit_content_search WHERE text LIKE '%geheim%'")
            assert cursor.fetchall() == []
            cursor.execute("SELECT block FROM audit_content_search_data")
            assert not [block for (block,) in cursor.fetchall() if b"geh" in bytes(block)]
    assert not Content.objects.filter(text__icontains="geheim").exists()


def test_contents_go_in_small_steps(ago, monkeypatch):
    monkeypatch.setattr(retention, "CONTENTS_AT_ONCE", 2)
    with ago(100):
        for number in range(5):
            record("speech.start", text=f"Sentence {number}.")
    assert exhaust(expire_contents(TODAY)) >= len(KINDS) + 3
    assert not Content.objects.filter(record__kind="speech.start").exists()


@pytest.mark.skipif(connection.vendor != "sqlite", reason="of SQLite's write-ahead log")
@pytest.mark.django_db(transaction=True)
def test_emptying_the_write_ahead_log_waits_for_no_process(caplog):
    record("speech.start", text="Zebrafisch")
    reader = sqlite3.connect(connection.settings_dict["NAME"], isolation_level=None)
    with closing(reader):
        reader.execute("BEGIN")
        reader.execute("SELECT 1 FROM audit_record").fetchone()
        record("speech.start", text="Later.")
        began = time.monotonic()
        assert exhaust(retention.empty_wal()) == retention.WAL_TRIES
        assert time.monotonic() - began < 2
        assert "is in use" in caplog.text
    with connection.cursor() as cursor:
        cursor.execute("PRAGMA busy_timeout")
        assert cursor.fetchone() == (5000,)
    assert exhaust(retention.empty_wal()) == 0


# --- whole records ----------------------------------------------------------------------------------


def test_records_go_up_to_a_checkpoint_of_their_chain(ago, five_years):
    for days in (1900, 1850, 1831, 1830, 10):
        with ago(days):
            record("speech.start", robot_id=ROBOT, robot_name="TIAGo 1", text=f"{days} days ago")
    third = Record.objects.get(robot_id=ROBOT, seq=3)
    with ago(0):
        exhaust(remove_old_records(TODAY))
    left = list(Record.objects.filter(robot_id=ROBOT).order_by("seq"))
    assert [(entry.seq, entry.kind) for entry in left] == [
        (4, "speech.start"),
        (5, "speech.start"),
        (6, "audit.checkpoint"),
    ]
    parameters = {"through": 3, "digest": third.digest, "removed": 3, "before": "2028-05-28"}
    assert left[-1].parameters == parameters
    assert not Content.objects.filter(text="1831 days ago").exists()
    assert verify_all().findings == []


def test_many_go_in_several_steps_each_with_its_checkpoint(ago, five_years, monkeypatch):
    monkeypatch.setattr(retention, "RECORDS_AT_ONCE", 2)
    with ago(2000):
        for _ in range(5):
            record("stop.press", robot_id=ROBOT)
    with ago(0):
        exhaust(remove_old_records(TODAY))
        assert verify_all().findings == []
        record("stop.press", robot_id=ROBOT)
    assert verify_all().findings == []
    checkpoints = Record.objects.filter(robot_id=ROBOT, kind="audit.checkpoint").order_by("seq")
    assert [entry.parameters["through"] for entry in checkpoints] == [2, 4, 5]


def test_a_clock_that_stands_wrong_removes_no_end_of_checkpoints(ago, five_years):
    with ago(1900):
        record("stop.press", robot_id=ROBOT)
    with ago(1890):
        exhaust(remove_old_records(TODAY))
    assert [entry.kind for entry in Record.objects.filter(robot_id=ROBOT)] == ["audit.checkpoint"]


def test_an_outcome_outlives_its_request(ago, five_years):
    with ago(1900):
        asked = record("motion.start", robot_id=ROBOT)
    with ago(10):
        record("motion.end", robot_id=ROBOT, of=asked)
    with ago(0):
        exhaust(remove_old_records(TODAY))
    connection.check_constraints()
    assert Record.objects.get(kind="motion.end").of_id == asked.pk


def test_nothing_beyond_the_checkpoint_can_be_removed(ago, five_years):
    with ago(1900):
        record("stop.press", robot_id=ROBOT)
    with ago(10):
        young = record("stop.press", robot_id=ROBOT)
    with ago(0):
        exhaust(remove_old_records(TODAY))
    with pytest.raises(DatabaseError, match="append-only"), transaction.atomic():
        Record.objects.filter(pk=young.pk)._raw_delete("default")


def test_a_checkpoint_of_another_robot_lets_nothing_go():
    mine = record("stop.press", robot_id=ROBOT)
    record(
        "audit.checkpoint", robot_id=uuid.UUID(int=9), parameters={"through": 99, "digest": "", "removed": 0}
    )
    record("audit.checkpoint", parameters={"through": 99, "digest": "", "removed": 0})
    with pytest.raises(DatabaseError, match="append-only"), transaction.atomic():
        Record.objects.filter(pk=mine.pk)._raw_delete("default")


def test_future_records_expire_with_their_successors(ago, five_years, monkeypatch):
    """Records of a time when the clock was ahead do not block removal or expiry for ever."""
    monkeypatch.setattr(retention, "RECORDS_AT_ONCE", 2)
    days = (1900, -20000, -20000, -20000, 1850, 10, -20000)
    for before in days:
        with ago(before):
            record("speech.start", robot_id=ROBOT, robot_name="TIAGo 1", text="Hello.")
    exhaust(remove_old_records(TODAY))
    left = Record.objects.filter(robot_id=ROBOT).order_by("seq").values_list("seq", flat=True)
    assert list(left) == [6, 7, 8, 9, 10]  # and three checkpoints
    assert verify_all().findings == []


def test_records_are_removed_without_later_ones_of_their_robot(ago, five_years):
    """The contents expired long before their records; the records of that expiry are removed, too."""
    with ago(-20000):
        record("speech.start", robot_id=ROBOT, text="the last words of this robot")
    with ago(1900):
        record("stop.press")
    with ago(1850):
        exhaust(expire_contents(TODAY))
    exhaust(remove_old_records(TODAY))
    assert [entry.kind for entry in Record.objects.filter(robot_id=ROBOT)] == ["audit.checkpoint"]
    assert not Record.objects.filter(kind="audit.expire").exists()
    assert verify_all().findings == []


def test_contents_of_a_wrong_clock_expire(ago):
    with ago(-20000):
        first = record("speech.start", text="by a clock that was ahead")
    with ago(91):
        record("stop.press")
    with ago(-20000):
        second = record("speech.start", text="by a clock that was ahead again")
    exhaust(expire_contents(TODAY))
    assert Record.objects.get(kind="audit.expire").parameters["misdated"] == [first.pk]
    assert list(Content.objects.filter(record__kind="speech.start").values_list("pk", flat=True)) == [
        second.pk
    ]
    assert verify_all().findings == []
    exhaust(expire_contents(TODAY))
    assert Record.objects.filter(kind="audit.expire").count() == 1


def test_no_other_contents_can_be_said_to_be_of_days_to_come(ago):
    with ago(10):
        young = record("speech.start", text="young")
    record("audit.expire", parameters={"kinds": {}, "misdated": [young.pk]})
    young.content.delete()
    [finding] = verify_all().findings
    assert (finding.number, finding.what) == (young.pk, "has lost its content too early.")


def test_removed_future_records_fit_heads_of_their_time(ago, five_years):
    with ago(1900):
        record("stop.press", robot_id=ROBOT)
    with ago(-20000):
        record("stop.press", robot_id=ROBOT)
    heads = verify_all().heads
    with ago(1850):
        record("stop.press", robot_id=ROBOT)
    exhaust(remove_old_records(TODAY))
    assert list(compare(heads)) == []


# --- the clock ----------------------------------------------------------------------------------------


@pytest.fixture
def spoken(ago):
    """`spoken(days, …)`: record a sentence for each of these numbers of days ago."""

    def speak(*days: int) -> None:
        for before in days:
            with ago(before):
                record("speech.start", text=f"{before} days ago")

    return speak


def kept() -> list[str]:
    return list(Content.objects.exclude(text="").order_by("pk").values_list("text", flat=True))


def housekeeping(at=TODAY) -> None:
    exhaust(retention.remove_expired(datetime(at.year, at.month, at.day, 12, tzinfo=UTC)))


def test_by_a_clock_that_is_years_ahead_nothing_goes(spoken, ago, caplog):
    """No text expires, before or after a person causes a record with the wrong date."""
    spoken(4000, 3999)
    for _ in range(2):
        housekeeping()
        assert kept()[:2] == ["4000 days ago", "3999 days ago"]
        spoken(0)
    assert "manage.py confirm_clock" in caplog.text
    [doubt] = Record.objects.filter(kind="audit.clock")  # one a day
    assert doubt.outcome == "doubted"


def test_expiry_continues_when_a_person_confirms_the_clock(spoken):
    spoken(150, 0)
    words = io.StringIO()
    call_command("confirm_clock", stdout=words)
    assert "it is 2033-06-01 12:00" in words.getvalue()
    reset = Record.objects.get(kind="audit.clock")
    assert (reset.outcome, reset.actor_id[:7]) == ("confirmed", "system:")
    housekeeping()
    assert kept() == ["0 days ago"]


def test_expiry_continues_after_days_without_use(spoken, ago):
    """The console runs without users. Its daily records about the doubted clock do not count as use."""
    spoken(150)
    for before in range(retention.SILENCE.days, 0, -1):
        with ago(before):
            housekeeping(TODAY - timedelta(days=before))
    assert kept() == ["150 days ago"]
    housekeeping()
    assert kept() == []


@pytest.mark.parametrize("days", [(100, 60, 20), (100, 61, 41, 1), (91, 80, 40)])
def test_no_silence_no_doubt(spoken, days):
    spoken(*days)
    housekeeping()
    assert f"{days[0]} days ago" not in kept()


def test_a_future_record_does_not_confirm_the_clock(spoken):
    spoken(150, -20000)
    housekeeping()
    assert "150 days ago" in kept()


@pytest.mark.parametrize("used", [True, False], ids=["used between", "idle"])
def test_a_clock_that_is_ahead_again_and_again_is_believed_never(spoken, ago, used):
    """The clock is wrong at each weekly start, then right. If idle, only housekeeping writes records then."""
    ahead = 3 * 365
    spoken(ahead + 60, ahead + 35)
    for week in range(8):
        for before in (-7 * week, ahead - 7 * week):
            today = TODAY - timedelta(days=before)
            with ago(before):
                if used or before < ahead / 2:
                    record("fault", outcome="away", text=f"{before} days ago")
                assert retention.clock_is_doubted(today) == (before < ahead / 2)
                housekeeping(today)
    assert f"{ahead + 35} days ago" in kept()
    assert verify_all().findings == []


def test_a_confirmed_clock_counts_for_its_time_only(spoken, ago):
    spoken(1000)
    with ago(0):
        call_command("confirm_clock", stdout=io.StringIO())
    spoken(999)
    with ago(-7):
        assert retention.clock_is_doubted(TODAY + timedelta(days=7))


def test_after_a_clock_that_was_years_behind_it_is_doubted_too(spoken):
    """Only a person can decide which of two clocks is right."""
    spoken(100, 60, 20, 4000, 0)
    housekeeping()
    assert "100 days ago" in kept()
    call_command("confirm_clock", stdout=io.StringIO())
    housekeeping()
    assert kept() == ["60 days ago", "20 days ago", "0 days ago"]


def test_a_clock_set_back_is_recorded_once(spoken):
    spoken(60, 30, -20000)
    for _ in range(2):
        housekeeping()
    assert list(Record.objects.filter(kind="audit.clock").values_list("outcome", "day")) == [
        ("set_back", TODAY)
    ]


# --- housekeeping -------------------------------------------------------------------------------------


def test_housekeeping_expires_contents(ago):
    with ago(0):
        record("speech.start", text="young")
    old = Content.objects.get(text="young").record
    with mock.patch.object(django_timezone, "now", return_value=datetime(2033, 12, 24, tzinfo=UTC)):
        call_command("confirm_clock", stdout=io.StringIO())
        call_command("run_housekeeping", "--once")
    assert Record.objects.get(pk=old.pk).details == {}
