"""Signing in and out, its records, and the limits on guessing passwords."""

import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from unittest import mock

import pytest
from django.contrib.sessions.models import Session
from django.core.management import call_command
from django.db import connection
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import SignIn, SignInAttempt, User
from fleet.accounts.sign_in import throttle
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from tests.conftest import PASSWORD
from tests.settings import PRODUCTION_PASSWORD_HASHERS

pytestmark = pytest.mark.django_db

PAGE = "/accounts/sign-in/"
SESSIONS = "/accounts/sessions/"


def _try(username, password, client=None, **extra):
    form = {"username": username, "password": password, "next": SESSIONS}
    return (client or Client()).post(PAGE, form, **extra)


def _records(kind):
    return list(Record.objects.filter(kind=kind).order_by("id"))


def test_the_right_password_leads_to_the_page_that_was_asked_for(operator):
    response = _try("operator", PASSWORD)
    assert (response.status_code, response.headers["Location"]) == (302, SESSIONS)


def test_a_foreign_address_is_not_followed_after_sign_in(operator):
    form = {"username": "operator", "password": PASSWORD, "next": "https://evil.example/"}
    assert Client().post(PAGE, form).headers["Location"] == "/"


def test_the_session_cookie_is_safe_from_scripts_and_sites(operator, settings):
    morsel = _try("operator", PASSWORD).cookies[settings.SESSION_COOKIE_NAME]
    assert morsel["httponly"]
    assert morsel["samesite"] == "Lax"


def test_a_form_without_its_token_is_refused(operator):
    assert _try("operator", PASSWORD, Client(enforce_csrf_checks=True)).status_code == 403


def test_a_sign_in_is_recorded_and_listed(operator):
    _try("operator", PASSWORD, headers={"user-agent": "Browser/1"}, REMOTE_ADDR="10.0.0.7")
    (entry,) = _records("account.sign_in")
    assert entry.actor_id == str(operator.pk)
    assert entry.details == {"address": "10.0.0.7", "browser": "Browser/1", "by": ["password"]}
    assert entry.parameters == {"by": ["password"]}  # the address is in a part that may expire
    sign_in = SignIn.objects.get(user=operator)
    assert (sign_in.address, sign_in.user_agent) == ("10.0.0.7", "Browser/1")


def test_a_sign_in_clears_away_the_persons_expired_sessions(operator, observer, signed_in):
    signed_in(operator)
    signed_in(observer)
    Session.objects.update(expire_date=timezone.now() - timedelta(days=1))
    _try("operator", PASSWORD)
    assert Session.objects.count() == 2
    assert SignIn.objects.filter(user=operator).count() == 1


def test_a_sign_out_is_recorded_and_unlisted(operator):
    client = Client()
    _try("operator", PASSWORD, client)
    assert client.post("/accounts/sign-out/").status_code == 302
    assert [entry.actor_name for entry in _records("account.sign_out")] == ["Olga Operator"]
    assert not SignIn.objects.exists()


def test_a_link_cannot_sign_anybody_out(operator, signed_in):
    assert signed_in(operator).get("/accounts/sign-out/").status_code == 405


def test_a_wrong_password_is_refused_and_recorded(operator):
    response = _try("operator", "wrong")
    (error,) = response.context["form"].non_field_errors().as_data()
    assert (response.status_code, error.code) == (200, "invalid_login")
    (entry,) = _records("account.sign_in_failed")
    assert (entry.actor_id, entry.outcome, entry.details["username"]) == (None, "refused", "operator")
    assert entry.parameters["user"] == str(operator.pk)
    assert "wrong" not in str(entry.details)


def test_names_and_addresses_expire_from_records(operator):
    _try("operator", "wrong")
    (entry,) = _records("account.sign_in_failed")
    assert entry.details["address"]
    assert not {"operator", entry.details["address"]} & set(map(str, entry.parameters.values()))


def test_an_unknown_name_is_not_kept_as_it_may_be_a_password(operator):
    _try(PASSWORD, "operator")
    (entry,) = _records("account.sign_in_failed")
    assert entry.details["username"] is None
    assert PASSWORD not in str(entry.details)


def test_a_closed_account_cannot_sign_in(operator):
    User.objects.update(is_active=False)
    assert _try("operator", PASSWORD).status_code == 200
    assert len(_records("account.sign_in_failed")) == 1


# --- throttling -------------------------------------------------------------------------------


@pytest.fixture
def guessed_too_often(operator):
    for _ in range(throttle.FAILURES):
        assert _try("operator", "wrong").status_code == 200


def test_after_ten_failures_even_the_right_password_must_wait(guessed_too_often):
    response = _try("operator", PASSWORD)
    (error,) = response.context["form"].non_field_errors().as_data()
    assert (response.status_code, error.code) == (429, "throttled")
    assert "Try again in 5 minutes" in error.messages[0]
    assert 290 <= int(response.headers["Retry-After"]) <= 300


def test_while_it_waits_the_password_is_not_looked_at(guessed_too_often):
    _try("operator", "wrong")
    assert len(_records("account.sign_in_failed")) == throttle.FAILURES


def test_another_address_need_not_wait(guessed_too_often):
    assert _try("operator", PASSWORD, REMOTE_ADDR="10.0.0.8").status_code == 302


def test_addresses_of_one_ipv6_network_are_one(operator):
    for number in range(throttle.FAILURES):
        _try("operator", "wrong", REMOTE_ADDR=f"2001:db8::{number}")
    assert _try("operator", PASSWORD, REMOTE_ADDR="2001:db8::ff").status_code == 429
    assert _try("operator", PASSWORD, REMOTE_ADDR="2001:db8:0:1::").status_code == 302


def test_another_name_need_not_wait(guessed_too_often, observer):
    assert _try("observer", PASSWORD).status_code == 302


def test_after_five_minutes_it_may_be_tried_again(guessed_too_often):
    later = timezone.now() + throttle.WINDOW + timedelta(seconds=1)
    with mock.patch.object(throttle.timezone, "now", return_value=later):
        assert _try("operator", PASSWORD).status_code == 302


def test_work_tried_under_a_wrong_clock_is_not_awaited(operator):
    a_year_ahead = timezone.now() + timedelta(days=365)
    with mock.patch.object(throttle.timezone, "now", return_value=a_year_ahead):
        for number in range(throttle.FAILURES_OF_ADDRESS):
            name = "operator" if number < throttle.FAILURES else f"name-{number}"
            throttle.failure_recorded(username=name, address="127.0.0.1")
    assert _try("operator", PASSWORD).status_code == 302


def test_unknown_names_are_throttled_alike(db):
    for _ in range(throttle.FAILURES):
        _try("nobody", "wrong")
    assert _try("nobody", "wrong").status_code == 429


def test_one_address_cannot_try_name_after_name(operator):
    for number in range(throttle.FAILURES_OF_ADDRESS):
        throttle.failure_recorded(username=f"name-{number}", address="10.0.0.66")
    assert _try("operator", PASSWORD, REMOTE_ADDR="10.0.0.66").status_code == 429
    assert _try("operator", PASSWORD, REMOTE_ADDR="10.0.0.67").status_code == 302


# --- nothing without a record -----------------------------------------------------------------


@pytest.mark.django_db(transaction=True)
def test_without_a_record_no_sign_in_succeeds(operator):
    client = Client()
    full = AuditUnavailable("audit_disk_full", "Not done: the disk is full.")
    with mock.patch("fleet.accounts.signals.record", autospec=True, side_effect=full):
        response = _try("operator", PASSWORD, client)
    assert response.status_code == 503
    assert "Not done: the disk is full." in response.content.decode()
    assert client.get(SESSIONS).status_code == 401
    assert not SignIn.objects.exists()


def test_a_failure_that_cannot_be_recorded_is_said_in_words(operator):
    full = AuditUnavailable("audit_disk_full", "Not done: the disk is full.")
    with mock.patch("fleet.accounts.sign_in.throttle.record", autospec=True, side_effect=full):
        response = _try("operator", "wrong")
    assert response.status_code == 503
    assert "Not done: the disk is full." in response.content.decode()


# --- passwords --------------------------------------------------------------------------------


def test_passwords_are_kept_by_bcrypt(settings, monkeypatch):
    settings.PASSWORD_HASHERS = PRODUCTION_PASSWORD_HASHERS
    monkeypatch.setenv("DJANGO_SUPERUSER_PASSWORD", PASSWORD)
    call_command("createsuperuser", "--noinput", username="first", email="", verbosity=0)
    first = User.objects.get(username="first")
    assert first.password.startswith("bcrypt_sha256$")
    assert first.is_staff
    assert first.check_password(PASSWORD)


def test_people_are_shown_by_full_name_or_else_by_user_name():
    assert User(username="olga", full_name="Olga Operator").display_name == "Olga Operator"
    assert User(username="olga").display_name == "olga"


@pytest.mark.django_db(transaction=True)
def test_attempts_at_the_same_moment_are_counted_together(operator):
    """All attempts begin before the first is decided, each with its own database connection."""
    asked = threading.Barrier(throttle.FAILURES + 5)

    def guess(_number):
        try:
            with throttle.attempt(username="operator", address="10.0.0.7"):
                asked.wait(30)
                return True
        except throttle.TooMany:
            asked.wait(30)
            return False
        finally:
            connection.close()

    with ThreadPoolExecutor(asked.parties) as everybody:
        let_in = list(everybody.map(guess, range(asked.parties)))
    assert let_in.count(True) == throttle.FAILURES
    with throttle.attempt(username="operator", address="10.0.0.7"):
        pass  # all had the right password and freed their places


def test_an_attempt_of_a_process_that_died_is_forgotten(operator):
    for _ in range(throttle.FAILURES):
        throttle._begin(throttle._digest("operator"), throttle._digest("10.0.0.7"))
    with pytest.raises(throttle.TooMany), throttle.attempt(username="operator", address="10.0.0.7"):
        pass
    SignInAttempt.objects.update(at=timezone.now() - throttle.ATTEMPT_LASTS - timedelta(seconds=1))
    with throttle.attempt(username="operator", address="10.0.0.7"):
        pass
    assert not SignInAttempt.objects.exists()
