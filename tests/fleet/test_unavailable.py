"""With a locked, full or missing database, every page explains this and changes nothing."""

import sqlite3

import pytest
from django.db import InterfaceError, OperationalError, connection
from django.http import HttpRequest
from django.test import Client, RequestFactory

from fleet.accounts.models import SignIn, User
from fleet.accounts.pages import views
from fleet.site.pages.unavailable import error_page
from robots.shared.wire import Stopped, StopState
from teleop.stop import emergency_stop
from tests.conftest import PASSWORD

SIGN_IN = "/accounts/sign-in/"
SESSIONS = "/accounts/sessions/"


@pytest.fixture
def lock(transactional_db):
    """`lock()`: let another process lock the database."""
    if connection.vendor != "sqlite":
        pytest.skip("locks the database file")
    other = sqlite3.connect(connection.settings_dict["NAME"])

    def begin():
        with connection.cursor() as cursor:
            cursor.execute("PRAGMA busy_timeout = 50")
        other.execute("BEGIN IMMEDIATE")

    yield begin
    other.close()
    connection.close()


def _says_locked(response):
    assert response.status_code == 503
    assert "another process keeps the database locked" in response.content.decode()
    assert response.headers["Retry-After"]


def test_sign_in_fails_while_the_database_is_locked(lock, operator):
    client = Client()
    lock()
    _says_locked(client.post(SIGN_IN, {"username": "operator", "password": PASSWORD}))
    assert client.get(SESSIONS).status_code == 401
    assert not SignIn.objects.exists()


def test_a_wrong_password_that_cannot_be_counted_is_not_judged(lock, operator):
    lock()
    _says_locked(Client().post(SIGN_IN, {"username": "operator", "password": "wrong"}))


@pytest.mark.parametrize("page", ["/accounts/sign-out/", f"{SESSIONS}end-others/"])
def test_sign_out_fails_while_the_database_is_locked(page, lock, operator, signed_in):
    desk = signed_in(operator)
    signed_in(operator)
    lock()
    _says_locked(desk.post(page))
    assert SignIn.objects.count() == 2
    assert desk.get(SESSIONS).status_code == 200


def test_the_admin_changes_nothing_while_it_is_locked(lock, operator, staff, signed_in):
    form = {"username": "operator", "full_name": "Other", "email": "", "is_active": "on"}
    admin = signed_in(staff)
    lock()
    _says_locked(admin.post(f"/admin/accounts/user/{operator.pk}/change/", form))
    assert User.objects.get(pk=operator.pk).full_name == "Olga Operator"


def test_a_script_gets_json(lock, operator, signed_in):
    desk = signed_in(operator)
    signed_in(operator)
    lock()
    response = desk.post(f"{SESSIONS}end-others/", headers={"accept": "application/json"})
    assert (response.status_code, response.json()["code"]) == (503, "database_locked")


def test_a_stop_without_scripts_is_answered_while_it_is_locked(lock, robot, operator, signed_in, monkeypatch):
    monkeypatch.setattr(emergency_stop.press_records, "add", lambda _press: None)
    monkeypatch.setattr(emergency_stop, "press_all", lambda _robots, _by: [Stopped(StopState("stopped"))])
    desk = signed_in(operator)
    lock()
    answer = desk.post(f"/robots/{robot.slug}/stop/", headers={"accept": "text/html"})
    assert (answer.status_code, "Stopped." in answer.text) == (200, True)


@pytest.mark.django_db
@pytest.mark.parametrize(
    "error", [OperationalError("connection refused"), InterfaceError("connection already closed")]
)
def test_a_database_that_is_away_is_named(error, operator, signed_in, monkeypatch):
    def away(_user_id):
        raise error

    monkeypatch.setattr(views, "sign_ins_of", away)
    response = signed_in(operator).get(SESSIONS)
    assert response.status_code == 503
    assert "Not done: the database does not answer." in response.content.decode()


def _after(error: Exception) -> int:
    request: HttpRequest = RequestFactory().get("/")
    try:
        raise error
    except type(error):
        return error_page(request).status_code


def test_errors_before_a_page_are_in_words_too():
    assert _after(OperationalError("connection refused")) == 503


def test_an_error_of_our_own_stays_one():
    assert _after(ZeroDivisionError()) == 500
