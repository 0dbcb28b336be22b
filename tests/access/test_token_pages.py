"""The pages of tokens: make a token, show it once, list and end it; staff manage service accounts."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Any
from uuid import uuid4

import pytest
from allauth.mfa.totp.internal import auth
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.services import service_account_make
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import MOST, token_make
from fleet.audit.models import Record
from robots.access.services import role_set
from robots.registry.models import Robot, Role
from tests.accounts.sign_in.test_second_factor import SECRET, code_of
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db

PAGE, NEW, ROBOTS = "/tokens/", "/tokens/new/", "/api/v1/robots"
SignedIn = Callable[[User], Client]


def shown_to_be(client: Client, password: str = PASSWORD) -> Client:
    """Type the password on the page *Is it you?*."""
    asked = client.get(NEW).headers["Location"]
    assert asked.startswith("/accounts/again/")
    assert client.post(asked, {"password": password}).headers["Location"] == NEW
    return client


def filled(client: Client, page: str = NEW, **fields: Any) -> Any:
    """Fill the form as the page shows it, and send it."""
    once = client.get(page).context["form"]["once"].value()
    form = {"name": "night-tests", "scopes": ["read"], "days": "30", "once": once, **fields}
    return client.post(page, form)


def slugs(text: str) -> Any:
    answer = Client().get(ROBOTS, headers={"authorization": f"Bearer {text}"})
    return [one["slug"] for one in answer.json()["robots"]] if answer.status_code == 200 else answer.json()


@pytest.fixture
def desk(operator: User, signed_in: SignedIn) -> Client:
    return shown_to_be(signed_in(operator))


@pytest.fixture
def service(staff: User) -> User:
    return service_account_make(name="Night tests", project="Grasping", actor=staff)


def test_a_token_made_on_the_page_works_and_is_shown_once(desk: Client, operator: User, robot: Robot) -> None:
    assert 'href="/tokens/"' in desk.get("/accounts/").text
    made = filled(desk, scopes=["read", "drive"])
    text = made.context["text"]
    assert text in made.text
    assert made.headers["Cache-Control"].startswith("max-age=0")
    assert slugs(text) == [robot.slug]

    listed = desk.get(PAGE).text
    assert text not in listed
    for words in (
        "night-tests",
        "take control and drive",
        "All robots.",
        "from 127.0.0.1",
        "expires",
    ):
        assert words in listed, words
    token = Token.objects.get()
    assert abs(token.expires_at - timezone.now() - timedelta(days=30)) < timedelta(minutes=1)
    assert (token.user, token.made_by) == (operator, operator)
    assert text not in str([record.details for record in Record.objects.all()])


def test_a_token_can_be_for_some_robots_only(desk: Client, operator: User, other_robot: Robot) -> None:
    role_set(robot=other_robot, user=operator, role=Role.OBSERVER, actor=operator)
    text = filled(desk, robots=[other_robot.slug]).context["text"]
    assert slugs(text) == [other_robot.slug]
    assert f"Only: {other_robot.name}." in " ".join(desk.get(PAGE).text.split())
    role_set(robot=other_robot, user=operator, role=None, actor=operator)
    assert slugs(text) == []
    assert "1 robot without a role" in desk.get(PAGE).text


def test_the_form_comes_after_a_fresh_password(operator: User, signed_in: SignedIn) -> None:
    client = signed_in(operator)
    asked = client.post(NEW, {"name": "x", "scopes": ["read"], "days": "30", "once": str(uuid4())})
    assert asked.headers["Location"].startswith("/accounts/again/")
    assert client.post(asked.headers["Location"], {"password": "wrong"}).status_code == 200
    assert not Token.objects.exists()
    resumed = client.post(asked.headers["Location"], {"password": PASSWORD})  # completes the first form
    assert resumed.context["text"].startswith("fleet_")
    assert Token.objects.get().name == "x"


def test_the_form_comes_after_a_code_of_the_second_factor(operator: User, signed_in: SignedIn) -> None:
    auth.TOTP.activate(operator, SECRET)
    client = signed_in(operator)
    assert client.get(NEW).status_code == 302
    again = f"/accounts/second-factor/reauthenticate/?next={NEW}"
    assert client.post(again, {"code": code_of(SECRET)}).headers["Location"] == NEW
    assert client.get(NEW).status_code == 200


def test_staff_without_the_demanded_second_factor_make_no_token(
    staff: User, signed_in: SignedIn, settings: Any
) -> None:
    settings.FLEET_STAFF_TWO_FACTOR = True
    client = signed_in(staff)
    for page in (PAGE, NEW, "/service-accounts/"):
        answer = client.get(page, headers={"accept": "text/html"})
        assert answer.headers["Location"] == "/accounts/second-factor/"


def test_a_form_that_is_sent_twice_makes_one_token(desk: Client) -> None:
    once = str(uuid4())
    first, second = filled(desk, once=once), filled(desk, once=once)
    assert first.status_code == 200
    assert second.headers["Location"] == PAGE
    assert "made already" in desk.get(PAGE).text
    assert Token.objects.count() == 1


@pytest.mark.parametrize(
    "fields",
    [
        {"name": ""},
        {"name": "x" * 41},
        {"name": "\0"},
        {"scopes": []},
        {"scopes": ["everything"]},
        {"days": "366"},
        {"days": "-1"},
        {"days": "soon"},
        {"once": "x"},
        {"robots": ["tiago-2"]},
    ],
)
def test_a_wrong_form_makes_nothing(fields: dict[str, Any], desk: Client, other_robot: Robot) -> None:
    answer = filled(desk, **fields)
    assert answer.status_code == 400
    assert answer.context["form"].errors
    assert not Token.objects.exists()


def test_names_are_unique_and_tokens_limited(desk: Client, operator: User) -> None:
    filled(desk)
    assert "a token with this name" in filled(desk, name=" night-tests ").text
    for number in range(MOST - 1):
        filled(desk, name=f"t{number}")
    full = filled(desk, name="one more")
    assert (full.status_code, Token.objects.count()) == (400, MOST)
    assert "end one first" in full.text


def test_a_person_ends_their_own_tokens_only(
    desk: Client, signed_in: SignedIn, observer: User, operator: User
) -> None:
    text = filled(desk).context["text"]
    end = f"/tokens/{Token.objects.get().pk}/end/"
    assert desk.get(end).status_code == 405
    assert signed_in(observer).post(end).status_code == 404
    assert signed_in(observer).get(PAGE).context["tokens"] == []
    assert desk.post(end).headers["Location"] == PAGE
    assert slugs(text)["code"] == "token_invalid"
    assert desk.post(end).headers["Location"] == PAGE
    assert "had ended already" in desk.get(PAGE).text
    [ended] = Record.objects.filter(kind="token.end")
    assert ended.actor_name == operator.display_name


def test_an_expired_token_is_listed_as_such_and_opens_nothing(desk: Client) -> None:
    text = filled(desk).context["text"]
    Token.objects.update(expires_at=timezone.now() - timedelta(hours=1))
    assert slugs(text)["code"] == "token_expired"
    assert '<span class="badge">expired</span>' in desk.get(PAGE).text


def test_staff_see_and_end_the_tokens_of_any_person(
    desk: Client, operator: User, staff: User, signed_in: SignedIn, teacher: User, course: Any
) -> None:
    text = filled(desk).context["text"]
    course.enrolments.create(person=operator)
    page = f"/people/{operator.pk}/"
    assert "night-tests" not in signed_in(teacher).get(page).text
    client = signed_in(staff)
    assert "night-tests" in client.get(page).text
    assert client.get(f"/people/{operator.pk}/tokens/new/").status_code == 302
    assert client.post(f"/tokens/{Token.objects.get().pk}/end/").headers["Location"] == page
    assert slugs(text)["code"] == "token_invalid"
    assert Record.objects.get(kind="token.end").actor_name == staff.display_name


# --- service accounts -----------------------------------------------------------------------------


def test_staff_make_a_service_account_with_role_and_token(
    staff: User, signed_in: SignedIn, robot: Robot, other_robot: Robot
) -> None:
    client = shown_to_be(signed_in(staff))
    made = client.post("/service-accounts/", {"name": " Night  tests", "project": "Grasping"})
    account = User.objects.get(project="Grasping")
    assert made.headers["Location"] == f"/people/{account.pk}/"
    assert (account.full_name, account.email, account.has_usable_password()) == ("Night tests", "", False)
    role = {"user": account.pk, "robot": robot.pk, "role": "operator"}
    assert client.post("/admin/robots/robotrole/add/", role).status_code == 302

    new = f"/people/{account.pk}/tokens/new/"
    assert other_robot.name not in client.get(new).text  # the account has no role on it
    text = filled(client, new, scopes=["read", "drive"]).context["text"]
    assert slugs(text) == [robot.slug]
    page = client.get(f"/people/{account.pk}/").text
    assert "Service account of the project Grasping" in page
    assert "by Sam Staff" in page
    listed = client.get("/service-accounts/").text
    assert "1 token" in listed
    assert "last used" in listed
    token = Token.objects.get()
    assert Record.objects.get(kind="token.make").actor_name == "Sam Staff"
    client.post(f"/tokens/{token.pk}/end/")
    assert slugs(text)["code"] == "token_invalid"


def test_a_closed_service_account_gets_no_access_and_no_token(
    staff: User, service: User, signed_in: SignedIn
) -> None:
    client = shown_to_be(signed_in(staff))
    new = f"/people/{service.pk}/tokens/new/"
    text = filled(client, new).context["text"]
    User.objects.filter(pk=service.pk).update(is_active=False)
    assert slugs(text)["code"] == "account_inactive"
    assert client.get(new).status_code == 404
    assert new not in client.get(f"/people/{service.pk}/").text


def test_staff_make_no_token_of_another_person(staff: User, operator: User, signed_in: SignedIn) -> None:
    client = shown_to_be(signed_in(staff))
    assert client.get(f"/people/{operator.pk}/tokens/new/").status_code == 404


@pytest.mark.parametrize("name", ["supervisor", "operator", "teacher", "stranger"])
def test_service_accounts_are_for_staff(
    name: str, service: User, signed_in: SignedIn, request: pytest.FixtureRequest
) -> None:
    token, _ = token_make(
        user=service,
        name="x",
        scopes=[Scope.READ],
        expires_at=timezone.now() + timedelta(days=1),
        actor=service,
    )
    client = shown_to_be(signed_in(request.getfixturevalue(name)))
    assert client.get("/service-accounts/").status_code == 403
    assert client.post("/service-accounts/", {"name": "a", "project": "b"}).status_code == 403
    assert client.get(f"/people/{service.pk}/tokens/new/").status_code == 403
    assert client.get(f"/people/{service.pk}/").status_code == 404
    assert client.post(f"/tokens/{token.pk}/end/").status_code == 404
    assert User.objects.exclude(project="").count() == Token.objects.count() == 1


@pytest.mark.parametrize("fields", [{"name": ""}, {"project": " "}, {"name": "x" * 81}, {"project": "\0"}])
def test_a_wrong_form_makes_no_account(fields: dict[str, str], staff: User, signed_in: SignedIn) -> None:
    answer = signed_in(staff).post("/service-accounts/", {"name": "a", "project": "b", **fields})
    assert answer.status_code == 400
    assert not User.objects.exclude(project="").exists()
