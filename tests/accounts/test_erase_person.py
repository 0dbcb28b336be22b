"""A person can be erased, and the log still verifies."""

import io
import subprocess
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest import mock

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.mfa.recovery_codes.internal.auth import RecoveryCodes
from allauth.socialaccount.models import SocialAccount
from django.core.management import CommandError, call_command
from django.db import connection, transaction

from fleet.accounts.models import User
from fleet.audit import retention
from fleet.audit.integrity.verify import verify_all
from fleet.audit.models import Actor, Content, Record
from fleet.audit.services import record
from fleet.site.management.commands import erase_person
from teleop.records import refusals
from tests.processes import until

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Skip the wait for unwritten records of other processes."""
    monkeypatch.setattr("fleet.site.management.commands.erase_person.sleep", lambda _s: None)


def erase(username: str = "operator") -> str:
    words = io.StringIO()
    call_command("erase_person", username, yes=True, stdout=words)
    return words.getvalue()


def test_nothing_names_an_erased_person_any_more(operator, staff):
    operator.email = "olga@lab.example"
    operator.save()
    record("speech.start", actor=operator, text="Olga was here.", parameters={"language": "en-GB"})
    record("control.hand_over", actor=staff, parameters={"to": str(operator.pk)}, private={"to_name": "Olga"})
    record("account.sign_in", actor=operator, private={"address": "10.0.0.7", "browser": "Olga's Browser"})
    record("robot.change", private={"holder": {"id": str(operator.pk), "name": "Olga"}})
    assert "is erased" in erase()
    everything = [
        *(str(entry.details) for entry in Record.objects.all()),
        *Actor.objects.values_list("name", flat=True),
        *Content.objects.values_list("text", flat=True),
        *map(str, User.objects.filter(pk=operator.pk).values()),
    ]
    assert not [line for line in everything if "Olga" in line or "olga" in line]


@pytest.mark.parametrize(
    "name", ["Zoë Müller-Ünal", 'Ann "The Arm" O\'Neil', "100% Bo_b", "李小龙", "back\\slash 🤖"]
)
def test_others_records_do_not_name_them_either(operator, staff, name):
    operator.full_name, operator.email = name, "olga@lab.example"
    operator.save()
    for private in (
        {"words": f"{name} has control: ask for it."},
        {"words": f"The robot was stopped by {name}."},
        {"figures": {"holders": [{"name": name}]}},
        {"fields": {name: True}},
        {"reason": "Ask olga@lab.example, Olga Operator, or operator."},
    ):
        record("refusal", actor=staff, private=private)
    said = record("control.ask", actor=staff, text=f"Is {name} there?")
    other = record("refusal", actor=staff, private={"words": f"Anna{name}s has control."})
    erase()
    left = Content.objects.filter(record__actor=str(staff.pk), record__kind__in=["refusal", "control.ask"])
    assert list(left.values_list("pk", flat=True)) == [other.pk]
    assert not Content.objects.filter(pk=said.pk).exists()
    assert verify_all().findings == []


@pytest.mark.parametrize(
    "step",
    [
        "fleet.audit.person_erasure._by_or_about",
        "fleet.audit.person_erasure.take_out",
        "fleet.audit.person_erasure.time.sleep",  # after the first content, which holds the account's names
    ],
)
def test_a_repeated_erasure_completes_an_interrupted_one(operator, staff, step, monkeypatch):
    monkeypatch.setattr(retention, "CONTENTS_AT_ONCE", 1)
    record("speech.start", actor=operator, text="Olga was here.")
    record("refusal", actor=staff, private={"words": "Olga Operator has control: ask for it."})
    with mock.patch(step, side_effect=KeyboardInterrupt), pytest.raises(KeyboardInterrupt):
        erase()
    operator.refresh_from_db()
    assert not operator.is_active
    erase(operator.username)
    assert not [data for data in Content.objects.values_list("text", "data") if "Olga" in str(data)]
    assert verify_all().findings == []


def test_it_waits_longer_than_the_fold_and_explains_restart(operator):
    assert erase_person.WRITTEN_S > refusals.GAP_S
    assert "interrupted: run it again" in erase()


def test_late_records_of_old_refusals_name_nobody(operator, staff, monkeypatch):
    """A web process holds repeated refusals in memory for some seconds."""

    def recorded_meanwhile(_s):
        operator.refresh_from_db()
        assert not operator.is_active, "while it waits, the person does nothing more"
        record("refusal", actor=staff, private={"words": "Olga Operator has control: ask for it."})

    monkeypatch.setattr("fleet.site.management.commands.erase_person.sleep", recorded_meanwhile)
    erase()
    assert not [data for data in Content.objects.values_list("data", flat=True) if "Olga" in str(data)]


@pytest.mark.skipif(connection.vendor == "sqlite", reason="SQLite has one writer")
@pytest.mark.django_db(transaction=True)
def test_an_erasure_finds_records_written_meanwhile(operator, staff):
    """A record that is committed late can have a lower number than the newest committed record."""

    def erase_and_close() -> None:
        erase()
        connection.close()

    robot_id = uuid.uuid4()
    record("stop.press", robot_id=robot_id)
    with ThreadPoolExecutor(1) as pool:
        with transaction.atomic():
            record("refusal", actor=staff, robot_id=robot_id, private={"words": "Olga Operator has control."})
            erased = pool.submit(erase_and_close)
            until(lambda: erased.done() or waits_for_us(), "an erasure that waits for us", 20.0)
        erased.result()
    assert not [data for data in Content.objects.values_list("text", "data") if "Olga" in str(data)]


def waits_for_us() -> bool:
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1 FROM pg_locks WHERE pg_backend_pid() = ANY(pg_blocking_pids(pid))")
        return cursor.fetchone() is not None


@pytest.mark.skipif(connection.vendor != "sqlite", reason="PostgreSQL's vacuum comes by itself, and later")
@pytest.mark.django_db(transaction=True)
def test_their_words_are_in_none_of_the_database_s_files(operator, staff):
    record("speech.start", actor=operator, text="Zebrafisch im Aquarium.")
    record("refusal", actor=staff, private={"words": "Olga Operator has control: ask for it."})
    path = Path(connection.settings_dict["NAME"])
    files = [path, path.with_name(f"{path.name}-wal")]
    words = [b"Zebrafisch", b"Olga Operator"]
    assert all(any(word in bytes_of(file) for file in files) for word in words)
    erase()
    assert not [(file.name, word) for file in files for word in words if word in bytes_of(file)]


def test_the_log_still_verifies(operator):
    record("speech.start", actor=operator, text="Olga was here.")
    erase()
    assert verify_all().findings == []


def test_the_records_stay_under_a_pseudonym(operator):
    said = record("speech.start", actor=operator, text="Hello.", parameters={"language": "en-GB"})
    erase()
    entry = Record.objects.get(pk=said.pk)
    assert entry.actor_name == f"Person {str(operator.pk)[:4]}"
    assert (entry.details, entry.actor.erased_at is not None) == ({"language": "en-GB"}, True)


def test_texts_of_other_people_stay(operator, staff):
    said = record("speech.start", actor=staff, text="Good morning.")
    erase()
    assert Record.objects.get(pk=said.pk).details == {"text": "Good morning."}


def test_an_erasure_is_recorded(operator):
    said = record("speech.start", actor=operator, text="Hello.")
    erase()
    entry = Record.objects.get(kind="audit.erase")
    assert entry.parameters["person"] == str(operator.pk) and said.pk in entry.parameters["records"]
    assert entry.actor_id.startswith("system:")


def test_the_account_is_closed(operator, signed_in, client):
    browser = signed_in(operator)
    erase()
    operator.refresh_from_db()
    assert not operator.is_active and not operator.has_usable_password()
    assert browser.get("/").status_code == 401


def test_a_name_is_not_written_over_a_pseudonym(operator):
    record("stop.press", actor=operator)
    erase()
    operator.save()  # a process that still holds the old account
    assert Actor.objects.get(pk=str(operator.pk)).name.startswith("Person ")


def test_an_unknown_person_is_named():
    with pytest.raises(CommandError, match="There is no account nobody"):
        erase("nobody")


@pytest.mark.parametrize("answer", ["", "yes"])
def test_one_is_asked_before(operator, monkeypatch, answer):
    monkeypatch.setattr("builtins.input", lambda _question: answer)
    with pytest.raises(CommandError, match="Nothing was erased"):
        call_command("erase_person", "operator")
    assert User.objects.get(pk=operator.pk).is_active


def test_ways_to_sign_in_are_erased_too(operator):
    EmailAddress.objects.create(user=operator, email="olga@lab.example", verified=True)
    RecoveryCodes.activate(operator)
    SocialAccount.objects.create(user=operator, provider="sso", uid="1", extra_data={"name": "Olga"})
    erase()
    assert not any(table.objects.exists() for table in (EmailAddress, Authenticator, SocialAccount))


def bytes_of(file: Path) -> bytes:
    """Read a file of the database in another process: to close it in this one would end SQLite's locks."""
    return subprocess.run(["cat", file], check=True, capture_output=True).stdout
