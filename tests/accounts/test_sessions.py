"""The sign-ins of a person, and how they end."""

from datetime import timedelta

import pytest
from django.contrib.sessions.models import Session
from django.db import OperationalError
from django.http import HttpResponse
from django.test import Client, RequestFactory
from django.utils import timezone

from fleet.accounts import services
from fleet.accounts.middleware import sign_in_seen
from fleet.accounts.models import SignIn
from fleet.accounts.selectors import sign_ins_of
from fleet.accounts.selectors import signed_in as still_signed_in
from fleet.audit.models import Record
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db

PAGE = "/accounts/sessions/"


@pytest.fixture
def desk(operator, signed_in):
    """The operator's first browser."""
    return signed_in(operator)


@pytest.fixture
def phone(operator, signed_in):
    """The operator's second browser."""
    return signed_in(operator)


def _alive(client, person):
    return bool(still_signed_in([(person.pk, client.session.session_key)]))


def _sign_in_of(client):
    return SignIn.objects.get(session_id=client.session.session_key)


def test_the_list_shows_ones_own_sign_ins_only(desk, phone, observer, signed_in):
    signed_in(observer)
    shown = desk.get(PAGE).context["sign_ins"]
    assert {sign_in.pk for sign_in in shown} == {_sign_in_of(desk).pk, _sign_in_of(phone).pk}


def test_the_list_does_not_give_away_session_keys(desk, phone):
    page = desk.get(PAGE).content.decode()
    assert desk.session.session_key not in page
    assert phone.session.session_key not in page


def test_a_sign_in_can_be_ended_from_elsewhere(desk, phone, operator):
    ending = _sign_in_of(phone).pk
    assert desk.post(f"{PAGE}{ending}/end/").headers["Location"] == PAGE
    assert phone.get(PAGE).status_code == 401
    assert _alive(desk, operator)
    (entry,) = Record.objects.filter(kind="account.sign_out")
    assert (entry.actor_id, entry.outcome) == (str(operator.pk), "ended from the session list")


def test_all_others_can_be_ended_at_once(desk, phone, operator, signed_in):
    signed_in(operator)
    desk.post(f"{PAGE}end-others/")
    assert [sign_in.pk for sign_in in SignIn.objects.all()] == [_sign_in_of(desk).pk]


def test_a_person_cannot_end_anothers_sign_in(desk, observer, signed_in):
    theirs = signed_in(observer)
    desk.post(f"{PAGE}{_sign_in_of(theirs).pk}/end/")
    desk.post(f"{PAGE}end-others/")
    assert _alive(theirs, observer)


def test_ending_this_pages_sign_in_leads_to_sign_in(desk, operator):
    answer = desk.post(f"{PAGE}{_sign_in_of(desk).pk}/end/")
    assert (answer.status_code, answer.headers["Location"]) == (302, "/accounts/sign-in/")
    assert not _alive(desk, operator)


def test_ending_another_sign_in_also_works_after_this_ended(desk, phone, monkeypatch):
    ending = _sign_in_of(phone).pk

    def ended_meanwhile(**_which):
        Session.objects.all().delete()
        return False

    monkeypatch.setattr(services, "sign_in_end", ended_meanwhile)
    assert desk.post(f"{PAGE}{ending}/end/").headers["Location"] == "/accounts/sign-in/"


@pytest.mark.parametrize("end", ["00000000-0000-0000-0000-000000000000/end/", "end-others/"])
def test_ending_needs_a_form_of_ours(end, operator, signed_in):
    client = Client(enforce_csrf_checks=True)
    client.force_login(operator)
    assert client.post(f"{PAGE}{end}").status_code == 403
    assert client.get(f"{PAGE}{end}").status_code == 405


# --- checks by live connections ---------------------------------------------------------------


def test_a_sign_in_is_alive_and_the_question_costs_one_query(desk, operator, django_assert_num_queries):
    key = desk.session.session_key
    with django_assert_num_queries(1):
        assert still_signed_in([(operator.pk, key)])


def test_it_ends_with_the_sign_out(desk, operator):
    key = desk.session.session_key
    desk.post("/accounts/sign-out/")
    assert not still_signed_in([(operator.pk, key)])


def test_it_ends_with_its_session(desk, operator, end_session):
    key = desk.session.session_key
    end_session(desk)
    assert not still_signed_in([(operator.pk, key)])


def test_it_ends_when_the_session_expires(desk, operator):
    Session.objects.update(expire_date=timezone.now() - timedelta(seconds=1))
    assert not _alive(desk, operator)


def test_it_ends_when_the_account_is_closed(desk, operator):
    operator.is_active = False
    operator.save()
    assert not _alive(desk, operator)


def test_a_sign_in_ends_with_any_change_of_the_password(desk, operator):
    operator.set_password("another long walk")
    operator.save()
    assert not _alive(desk, operator)


def test_it_is_one_persons_only(desk, observer):
    assert not _alive(desk, observer)


def test_a_new_password_keeps_this_sign_in_ends_others(staff, signed_in):
    here, there = signed_in(staff), signed_in(staff)
    form = {
        "old_password": PASSWORD,
        "new_password1": "another long walk",
        "new_password2": "another long walk",
    }
    assert here.post("/accounts/password/", form).status_code == 302
    staff.refresh_from_db()
    assert _alive(here, staff)
    assert not _alive(there, staff)
    assert [sign_in.pk for sign_in in sign_ins_of(staff.pk)] == [_sign_in_of(here).pk]


def test_a_session_ended_during_a_page_stays_ended(transactional_db, desk, operator):
    def ended_meanwhile(_request):
        Session.objects.all().delete()
        return HttpResponse()

    request = RequestFactory().get(PAGE)
    request.user, request.session = operator, desk.session
    assert sign_in_seen(ended_meanwhile)(request).status_code == 200
    assert not SignIn.objects.exists()


# --- last seen --------------------------------------------------------------------------------


def test_a_page_is_noted_at_most_once_a_minute(desk):
    first = _sign_in_of(desk).seen_at
    desk.get(PAGE)
    assert _sign_in_of(desk).seen_at == first


def test_after_a_minute_a_page_moves_last_seen_and_the_expiry(desk):
    long_ago = timezone.now() - timedelta(minutes=30)
    SignIn.objects.update(seen_at=long_ago)
    session = desk.session
    session["seen_at"] = long_ago.timestamp()
    session.save()
    Session.objects.update(expire_date=timezone.now() + timedelta(minutes=5))
    desk.get(PAGE)
    assert timezone.now() - _sign_in_of(desk).seen_at < timedelta(minutes=1)
    assert Session.objects.get().expire_date > timezone.now() + timedelta(hours=11)


def test_a_page_does_not_fail_because_that_cannot_be_written(desk, monkeypatch):
    def full(*_):
        raise OperationalError("database or disk is full")

    monkeypatch.setattr(services, "sign_in_seen", full)
    assert desk.get(PAGE).status_code == 200
