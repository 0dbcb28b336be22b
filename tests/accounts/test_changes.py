"""Every change of an account is recorded, also changes by the command line."""

from __future__ import annotations

import os
import pwd
from typing import Any
from unittest import mock

import pytest
from django.contrib.auth import authenticate
from django.core.management import call_command

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.audit.services import record
from tests.conftest import PASSWORD

NEW = "another long walk"
FULL = AuditUnavailable("audit_disk_full", "Not done: the disk is full.")
HERE = pwd.getpwuid(os.getuid()).pw_name

pytestmark = pytest.mark.django_db


def changes_of(person: User) -> list[list[dict[str, Any]]]:
    """Return the recorded changes of an account, oldest first."""
    records = Record.objects.filter(kind="account.change", parameters__user=str(person.pk)).order_by("id")
    return [entry.details["changes"] for entry in records]


def test_the_first_staff_account_is_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DJANGO_SUPERUSER_PASSWORD", PASSWORD)
    call_command("createsuperuser", "--no-input", username="first", email="first@lab.example", verbosity=0)
    entry = Record.objects.get(kind="account.create")
    assert (entry.actor_id, entry.actor_name) == (f"system:{HERE}", HERE)
    assert entry.details["name"] == "first"
    given = {change["field"]: change["to"] for change in entry.details["changes"]}
    assert given == {
        "username": "first",
        "email": "first@lab.example",
        "is_staff": True,
        "is_superuser": True,
    }
    assert PASSWORD not in str(entry.details)


def test_an_account_that_cannot_be_recorded_is_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DJANGO_SUPERUSER_PASSWORD", PASSWORD)
    with (
        mock.patch("fleet.accounts.changes.record", autospec=True, side_effect=FULL),
        pytest.raises(AuditUnavailable),
    ):
        call_command("createsuperuser", "--no-input", username="first", email="", verbosity=0)
    assert not User.objects.exists()


def test_a_password_changed_by_command_is_recorded(stranger: User) -> None:
    with mock.patch("getpass.getpass", return_value=NEW):
        call_command("changepassword", stranger.username)
    assert changes_of(stranger) == [[{"field": "password"}]]
    assert NEW not in str(Record.objects.latest("id").details)


@pytest.mark.parametrize("right", ["is_active", "is_staff", "is_superuser"])
def test_each_gained_or_lost_right_is_recorded(right: str, stranger: User) -> None:
    before = getattr(stranger, right)
    for value in (not before, before):
        setattr(stranger, right, value)
        stranger.save()
    assert changes_of(stranger) == [
        [{"field": right, "from": before, "to": not before}],
        [{"field": right, "from": not before, "to": before}],
    ]


def test_a_deleted_account_is_recorded(stranger: User) -> None:
    gone = str(stranger.pk)
    User.objects.filter(pk=stranger.pk).delete()
    entry = Record.objects.get(kind="account.delete")
    assert (entry.details["user"], entry.details["name"]) == (gone, "Stig Stranger")


def test_a_removed_password_is_recorded(stranger: User) -> None:
    stranger.set_unusable_password()
    stranger.save()
    assert changes_of(stranger) == [[{"field": "password"}]]


def test_unsaved_changes_are_not_recorded(stranger: User) -> None:
    stranger.is_staff = True
    stranger.full_name = "Stig S."
    stranger.save(update_fields=["full_name"])
    [[change]] = changes_of(stranger)
    assert change["field"] == "full_name"


def test_names_and_addresses_may_expire_and_rights_may_not(stranger: User) -> None:
    stranger.email, stranger.is_staff = "stig@lab.example", True
    stranger.save()
    kept = Record.objects.latest("id").parameters
    assert kept["user"] == str(stranger.pk)
    assert kept["changes"] == [{"field": "email"}, {"field": "is_staff", "from": False, "to": True}]
    assert "Stig" not in str(kept)


def test_a_newer_hash_of_the_same_password_is_no_change(stranger: User, settings: Any) -> None:
    settings.PASSWORD_HASHERS = [
        "django.contrib.auth.hashers.PBKDF2PasswordHasher",
        *settings.PASSWORD_HASHERS,
    ]
    before = stranger.password
    assert authenticate(username=stranger.username, password=PASSWORD) == stranger
    assert User.objects.get(pk=stranger.pk).password != before
    assert changes_of(stranger) == []


def test_old_records_show_a_persons_current_name(operator):
    earlier = record("stop.press", actor=operator)
    operator.full_name = "Olga Other"
    operator.save()
    assert Record.objects.get(pk=earlier.pk).actor_name == "Olga Other"
