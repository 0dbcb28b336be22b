"""Single sign-on at a real OpenID Connect provider."""

from __future__ import annotations

import html
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import requests
from allauth.account.models import EmailAddress
from allauth.core.exceptions import ImmediateHttpResponse
from allauth.mfa.totp.internal.auth import TOTP, generate_totp_secret
from allauth.socialaccount.models import SocialAccount, SocialLogin
from django.core.exceptions import ImproperlyConfigured
from django.test import Client, RequestFactory

from fleet.accounts.models import User
from fleet.accounts.sign_in.adapters import SingleSignOnAdapter
from fleet.audit.models import Record
from fleet.base.environment import Environment, single_sign_on
from robots.access.models import Course
from robots.access.selectors import lab_date, role_on
from robots.registry.models import Robot, Role
from tests.accounts.sign_in.provider import CLIENT, PASSWORD, SECRET
from tests.conftest import PASSWORD as PASSWORD_HERE

CONSOLE = "http://testserver"
START = "/accounts/oidc/sso/login/"


@pytest.fixture(scope="module")
def groups(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file in which the provider finds the groups of people."""
    return tmp_path_factory.mktemp("provider") / "groups.json"


@pytest.fixture(scope="module")
def provider(groups: Path) -> Iterator[str]:
    """Run the provider; return its address."""
    command = [sys.executable, "-m", "tests.accounts.sign_in.provider"]
    arguments = [str(groups.parent), f"{CONSOLE}{START}callback/"]
    with subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True) as process:
        yield f"http://127.0.0.1:{process.stdout.readline().strip()}"  # type: ignore[union-attr]
        process.kill()


@pytest.fixture
def sign_in_there(provider: str, settings: Any) -> Callable[..., Any]:
    """`sign_in_there("ada")`: follow the console's link, sign in at the provider, and come back."""
    variables = {"FLEET_OIDC_URL": provider, "FLEET_OIDC_CLIENT_ID": CLIENT, "FLEET_OIDC_SECRET": SECRET}
    settings.SOCIALACCOUNT_PROVIDERS = single_sign_on(
        Environment({**variables, "FLEET_OIDC_NAME": "University"})
    )

    def go(name: str, client: Client, *, start: str = START) -> Any:
        away = client.get(start)
        assert away.status_code == 302, away.content
        with requests.Session() as browser:
            page = browser.get(away.headers["Location"])
            form = dict(re.findall(r'name="(\w+)"\s+value="([^"]*)"', html.unescape(page.text)))
            answer = browser.post(
                page.url, {**form, "login": name, "password": PASSWORD}, allow_redirects=False
            )
            while not answer.headers["Location"].startswith(CONSOLE):
                answer = browser.get(
                    requests.compat.urljoin(page.url, answer.headers["Location"]), allow_redirects=False
                )
        return client.get(answer.headers["Location"].removeprefix(CONSOLE))

    return go


@pytest.mark.django_db(transaction=True)
def test_a_newcomer_gets_an_account_without_roles(sign_in_there: Callable[..., Any]) -> None:
    client = Client()
    assert "Sign in with University" in client.get("/accounts/sign-in/").content.decode()
    assert sign_in_there("ada", client).headers["Location"] == "/"
    ada = User.objects.get(email="ada@lab.example")
    assert (ada.full_name, ada.has_usable_password(), ada.is_staff) == ("Ada Lovelace", False, False)
    kinds = list(Record.objects.filter(actor_id=str(ada.pk)).order_by("id").values_list("kind", flat=True))
    assert kinds == ["account.create", "account.single_sign_on", "account.sign_in"]
    assert Record.objects.get(kind="account.sign_in").parameters == {"by": ["socialaccount"]}
    assert sign_in_there("ada", Client()).status_code == 302  # the second time it is the same account
    assert User.objects.count() == 1


@pytest.mark.django_db(transaction=True)
def test_groups_at_the_provider_become_courses(
    sign_in_there: Callable[..., Any],
    groups: Path,
    robot: Robot,
    staff: User,
    signed_in: Callable[[User], Client],
) -> None:
    today = lab_date()
    course = Course.objects.create(name="HRI", slug="hri", starts_on=today, ends_on=today)
    course.robots.add(robot)
    page = signed_in(staff)
    page.post("/sign-in-rules/", {"claim": "groups", "value": "hri-2026", "course": course.pk})
    groups.write_text('{"ada": ["staff-of-physics", "hri-2026"]}')
    sign_in_there("ada", Client())
    ada = User.objects.get(email="ada@lab.example")
    assert role_on(ada, robot) is Role.OPERATOR
    groups.write_text('{"ada": ["staff-of-physics"]}')
    sign_in_there("ada", Client())
    assert role_on(ada, robot) is None
    kinds = Record.objects.filter(kind__startswith="course.").order_by("pk").values_list("kind", flat=True)
    assert list(kinds) == ["course.enrol", "course.unenrol"]


@pytest.mark.django_db(transaction=True)
def test_a_verified_address_leads_to_the_account(sign_in_there: Callable[..., Any], operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(email="ada@lab.example")
    password = operator.password
    client = Client()
    sign_in_there("ada", client)
    assert client.get("/accounts/").context["user"] == operator
    operator.refresh_from_db()
    assert operator.password == password  # the password still works


@pytest.mark.django_db(transaction=True)
def test_an_unverified_address_takes_no_account(sign_in_there: Callable[..., Any], operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(email="eve@lab.example")
    client = Client()
    answer = sign_in_there("eve", client)
    assert answer.status_code == 403
    assert "Sign in with your password first" in answer.content.decode()
    assert not SocialAccount.objects.exists()
    assert client.get("/accounts/").status_code == 401


@pytest.mark.django_db(transaction=True)
def test_a_newcomers_unverified_address_is_not_taken_over(sign_in_there: Callable[..., Any]) -> None:
    sign_in_there("eve", Client())
    eve = User.objects.get()
    assert (eve.username, eve.email) == ("eve", "")  # no address: course lists enrol people by address
    assert not EmailAddress.objects.exists()


@pytest.mark.django_db(transaction=True)
def test_an_address_that_another_person_typed_stops_no_newcomer(
    sign_in_there: Callable[..., Any], operator: User
) -> None:
    EmailAddress.objects.create(user=operator, email="ada@lab.example", verified=False)
    assert sign_in_there("ada", Client()).headers["Location"] == "/"
    assert User.objects.get(email="ada@lab.example") != operator


@pytest.mark.django_db(transaction=True)
def test_an_address_of_another_person_now_leads_to_no_account(
    sign_in_there: Callable[..., Any], operator: User
) -> None:
    User.objects.filter(pk=operator.pk).update(email="ada@lab.example")
    SocialAccount.objects.create(user=operator, provider="sso", uid="who had this address last year")
    client = Client()
    answer = sign_in_there("ada", client)
    assert (answer.status_code, "ask the staff" in answer.content.decode()) == (403, True)
    assert client.get("/accounts/").status_code == 401
    assert SocialAccount.objects.count() == 1


@pytest.mark.django_db(transaction=True)
def test_an_account_is_joined_with_one_person_only(
    sign_in_there: Callable[..., Any], operator: User, signed_in: Callable[[User], Client]
) -> None:
    operator.set_unusable_password()  # so the console asks for no password before joining
    operator.save()
    SocialAccount.objects.create(user=operator, provider="sso", uid="their own")
    client = Client()
    client.force_login(operator)
    sign_in_there("eve", client, start=f"{START}?process=connect")  # a link that somebody sent them
    assert SocialAccount.objects.get().uid == "their own"


@pytest.mark.django_db(transaction=True)
def test_a_closed_account_is_not_joined(sign_in_there: Callable[..., Any], operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(email="ada@lab.example", is_active=False)
    assert sign_in_there("ada", Client()).headers["Location"] == "/accounts/closed/"
    assert not SocialAccount.objects.exists()


@pytest.mark.django_db(transaction=True)
def test_nobody_signs_in_to_a_service_account(sign_in_there: Callable[..., Any], operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(email="ada@lab.example", project="Grasping")
    assert sign_in_there("ada", Client()).headers["Location"] == "/accounts/closed/"
    assert not SocialAccount.objects.exists()

    User.objects.filter(pk=operator.pk).update(project="")
    sign_in_there("ada", Client())
    User.objects.filter(pk=operator.pk).update(project="Grasping")  # joined before, as a person's account
    client = Client()
    assert sign_in_there("ada", client).headers["Location"] == "/accounts/closed/"
    assert client.get("/accounts/").status_code == 401


@pytest.mark.parametrize("word", ["false", "False", 0, None, "no"])
@pytest.mark.django_db
def test_a_provider_that_writes_false_as_a_text_verifies_nothing(word: Any, operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(email="ada@lab.example")
    addresses = [EmailAddress(email="ada@lab.example", verified=word)]
    login = SocialLogin(User(), SocialAccount(provider="sso", uid="1"), email_addresses=addresses)
    with pytest.raises(ImmediateHttpResponse):
        SingleSignOnAdapter().pre_social_login(RequestFactory().get("/"), login)


@pytest.mark.django_db(transaction=True)
def test_the_second_factor_is_asked_for_here_too(sign_in_there: Callable[..., Any], operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(email="ada@lab.example")
    TOTP.activate(operator, generate_totp_secret())
    client = Client()
    assert sign_in_there("ada", client).headers["Location"] == "/accounts/second-factor/authenticate/"
    assert client.get("/accounts/").status_code == 401


@pytest.mark.django_db(transaction=True)
def test_a_person_joins_the_two_and_parts_them(
    sign_in_there: Callable[..., Any], operator: User, signed_in: Callable[[User], Client]
) -> None:
    client = signed_in(operator)
    asked = sign_in_there("eve", client, start=f"{START}?process=connect").headers["Location"]
    assert asked == "/accounts/again/"
    client.post(asked, {"password": PASSWORD_HERE})
    account = SocialAccount.objects.get(user=operator)
    client.post("/accounts/single-sign-on/", {"account": account.pk})
    assert not SocialAccount.objects.exists()
    outcomes = Record.objects.filter(kind="account.single_sign_on").order_by("id")
    assert [record.outcome for record in outcomes] == ["joined", "parted"]


@pytest.mark.django_db
def test_a_provider_that_is_away_is_said_in_words(sign_in_there: Callable[..., Any], settings: Any) -> None:
    app = settings.SOCIALACCOUNT_PROVIDERS["openid_connect"]["APPS"][0]
    app["settings"]["server_url"] = "http://127.0.0.1:9"
    answer = Client().get(START)
    assert "Single sign-on did not work" in answer.content.decode()


def test_settings_that_are_incomplete_stop_the_start() -> None:
    with pytest.raises(ImproperlyConfigured, match="FLEET_OIDC_CLIENT_ID is not set"):
        single_sign_on(Environment({"FLEET_OIDC_URL": "https://login.example.org"}))
    with pytest.raises(ImproperlyConfigured, match="FLEET_OIDC_URL is 'login"):
        single_sign_on(Environment({"FLEET_OIDC_URL": "login.example.org"}))
