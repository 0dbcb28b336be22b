"""Tokens of programs and service accounts: they open the API, but no page."""

from __future__ import annotations

import io
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.core.mail import EmailMessage
from django.core.management import call_command
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.services import account_close, service_account_make
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import (
    LISTED,
    MOST,
    TokenExists,
    TooManyTokens,
    token_end,
    token_make,
)
from fleet.audit.models import Record
from robots.access.password_links import codes_of
from robots.access.services import role_set
from robots.registry.models import Robot, Role
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db

ROBOTS = "/api/v1/robots"


def make(person: User, *, days: float = 1, **options: Any) -> tuple[Token, str]:
    fields = {
        "name": "night-tests",
        "scopes": [Scope.READ],
        "actor": person,
        "expires_at": timezone.now() + timedelta(days=days),
    }
    return token_make(**{"user": person, **fields, **options})


def ask(text: str) -> Any:
    return Client().get(ROBOTS, headers={"authorization": f"Bearer {text}"})


@pytest.fixture
def service(staff: User) -> User:
    return service_account_make(name="Night tests", project="Grasping", actor=staff)


def test_ended_expired_and_closed_tokens_open_nothing(operator: User) -> None:
    ended, ended_text = make(operator)
    assert ask(ended_text).status_code == 200
    token_end(token=ended, actor=operator)
    assert ask(ended_text).json()["code"] == "token_invalid"

    expired, expired_text = make(operator)
    Token.objects.filter(pk=expired.pk).update(expires_at=timezone.now())
    assert ask(expired_text).json()["code"] == "token_expired"

    _, text = make(operator)
    User.objects.filter(pk=operator.pk).update(is_active=False)
    assert ask(text).json()["code"] == "account_inactive"


def test_an_erased_person_has_no_token(operator: User, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fleet.site.management.commands.erase_person.sleep", lambda _s: None)
    _, text = make(operator, name="of-olga")
    call_command("erase_person", "operator", yes=True, stdout=io.StringIO())
    assert ask(text).status_code == 401
    assert not Token.objects.exists()
    assert not [one for one in Record.objects.all() if "of-olga" in str(one.details)]


def test_a_closed_account_loses_its_tokens_at_once(operator: User) -> None:
    make(operator)
    account_close(user=operator)
    assert not Token.objects.exists()


def test_housekeeping_removes_tokens_that_expired_long_ago(operator: User) -> None:
    old, _ = make(operator)
    recent, _ = make(operator)
    Token.objects.filter(pk=old.pk).update(expires_at=timezone.now() - LISTED - timedelta(hours=1))
    Token.objects.filter(pk=recent.pk).update(expires_at=timezone.now() - timedelta(hours=1))
    call_command("run_housekeeping", "--once")
    assert list(Token.objects.values_list("pk", flat=True)) == [recent.pk]


def test_tokens_of_a_person_are_limited_and_each_id_is_unique(operator: User) -> None:
    first, _ = make(operator)
    with pytest.raises(TokenExists):
        make(operator, token_id=first.pk)
    for _ in range(MOST - 1):
        make(operator)
    with pytest.raises(TooManyTokens):
        make(operator)


def test_expired_tokens_do_not_count_for_the_limit(operator: User) -> None:
    for _ in range(MOST):
        make(operator)
    Token.objects.update(expires_at=timezone.now() - timedelta(hours=1))
    make(operator)


def test_the_log_says_that_the_command_made_a_token(operator: User) -> None:
    words = io.StringIO()
    call_command("make_token", "operator", "night-tests", "read", stdout=words)
    assert ask(words.getvalue().strip()).status_code == 200
    made = Record.objects.get(kind="token.make")
    assert (made.parameters["user"], made.actor_id) != (str(operator.pk), str(operator.pk))


# --- service accounts -----------------------------------------------------------------------------


def test_a_service_account_has_no_password_and_is_on_record(service: User, staff: User) -> None:
    assert (service.username, service.email, service.has_usable_password()) == ("night-tests", "", False)
    again = service_account_make(name="Night Tests!", project="Grasping", actor=staff)
    assert again.username == "night-tests-2"
    made = Record.objects.get(kind="account.create", parameters__user=str(service.pk))
    assert made.actor_name == "Sam Staff"
    assert {"field": "project", "from": "", "to": "Grasping"} in made.details["changes"]


def test_a_service_accounts_token_sees_what_its_roles_allow(
    service: User, staff: User, robot: Robot, other_robot: Robot
) -> None:
    _, text = make(service, actor=staff)
    assert ask(text).json() == {**ask(text).json(), "robots": []}
    role_set(robot=robot, user=service, role=Role.OPERATOR, actor=staff)
    assert [one["slug"] for one in ask(text).json()["robots"]] == [robot.slug]


def with_ways_in(service: User) -> User:
    """Give the service account an address and a password, as by a mistake in the database."""
    service.email = "night@lab.example"
    service.set_password(PASSWORD)
    service.save()
    return service


@pytest.mark.parametrize("name", ["night-tests", "night@lab.example"])
def test_a_service_account_cannot_sign_in_by_password(name: str, service: User) -> None:
    with_ways_in(service)
    client = Client()
    answer = client.post("/accounts/sign-in/", {"username": name, "password": PASSWORD})
    assert answer.status_code == 200
    assert answer.context["form"].errors
    assert client.get("/accounts/").status_code == 401


def test_a_service_account_gets_no_link_for_a_new_password(
    service: User, mailoutbox: list[EmailMessage]
) -> None:
    with_ways_in(service)
    answer = Client().post("/accounts/password/forgotten/", {"email": "night@lab.example"})
    assert answer.status_code == 302  # the same as for every address
    assert not [mail for mail in mailoutbox if "/password/new/" in str(mail.body)]


def test_a_welcome_link_sets_no_password_of_a_service_account(service: User) -> None:
    assert Client().get(f"/welcome/{codes_of([service])[service.pk]}/").status_code == 410


def test_a_session_of_a_service_account_opens_nothing(
    operator: User, signed_in: Callable[[User], Client]
) -> None:
    client = signed_in(operator)
    assert client.get("/accounts/").status_code == 200
    User.objects.filter(pk=operator.pk).update(project="Grasping")
    assert client.get("/accounts/").status_code == 401
    assert client.get(ROBOTS).status_code == 401


def test_staff_cannot_give_a_service_account_a_password(
    service: User, staff: User, signed_in: Callable[[User], Client]
) -> None:
    client, page = signed_in(staff), f"/admin/accounts/user/{service.pk}/password/"
    typed = {"password1": PASSWORD, "password2": PASSWORD, "usable_password": "true"}
    for answer in (client.get(page), client.post(page, typed)):
        assert answer.headers["Location"] == f"/people/{service.pk}/"
    service.refresh_from_db()
    assert not service.has_usable_password()
    shown = client.get(f"/admin/accounts/user/{service.pk}/change/").text
    assert "Grasping" in shown
