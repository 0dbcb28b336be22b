"""E-mail addresses: sign-in, new password, and change of address."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import Any

import pytest
from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from django.core import mail
from django.core.cache import cache
from django.db import IntegrityError
from django.test import Client
from django.utils import timezone

from fleet.accounts import emails
from fleet.accounts.models import SignIn, User
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import token_make
from fleet.audit.models import Record
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db(transaction=True)

FORGOTTEN = "/accounts/password/forgotten/"
NEW = "another long walk on the beach"


@pytest.fixture(autouse=True)
def _no_limits() -> Iterator[None]:
    """Clear the counts of e-mails to each address: the process keeps them after a test."""
    cache.clear()
    yield
    cache.clear()


@pytest.fixture
def olga(operator: User) -> User:
    """The operator, with an e-mail address."""
    operator.email = "Olga@Lab.example"
    operator.save()
    return operator


def letter(count: int = 1) -> Any:
    """Wait for the `count`-th e-mail, which another thread sends."""
    until = time.monotonic() + 10
    while len(mail.outbox) < count and time.monotonic() < until:
        time.sleep(0.01)
    return mail.outbox[count - 1]


def link_in(message: Any) -> str:
    return re.search(r"http://testserver(/\S+)", message.body)[1]  # type: ignore[index]


def test_people_sign_in_by_their_address_too(olga: User) -> None:
    answer = Client().post("/accounts/sign-in/", {"username": "OLGA@lab.example", "password": PASSWORD})
    assert answer.headers["Location"] == "/"


def test_wrong_passwords_count_for_name_and_address_together(olga: User) -> None:
    for name in ("operator", "olga@lab.example") * 5:
        Client().post("/accounts/sign-in/", {"username": name, "password": "wrong"})
    answer = Client().post("/accounts/sign-in/", {"username": "operator", "password": PASSWORD})
    assert answer.status_code == 429


def test_no_two_accounts_have_one_address(olga: User, observer: User) -> None:
    observer.email = "olga@LAB.example"
    with pytest.raises(IntegrityError):
        observer.save()


def test_a_forgotten_password_is_set_by_a_link(olga: User, signed_in: Callable[[User], Client]) -> None:
    elsewhere = signed_in(olga)
    client = Client()
    assert client.post(FORGOTTEN, {"email": "Olga@lab.example"}).status_code == 302
    link = link_in(letter())
    assert "Your user name is operator" in mail.outbox[0].body
    page = client.get(link).headers["Location"]  # has no key, so that no other site sees the key
    assert client.post(page, {"password1": "12345678", "password2": "12345678"}).status_code == 200
    assert client.post(page, {"password1": NEW, "password2": NEW}).status_code == 302
    assert SignIn.objects.get(user=olga).session_id == client.session.session_key
    assert Record.objects.get(kind="account.sign_out").outcome == "password reset"
    assert client.get("/accounts/").wsgi_request.user == olga
    assert elsewhere.get("/accounts/").status_code == 401
    assert "This link does not work" in Client().get(link).content.decode()
    changed = Record.objects.filter(kind="account.change").latest("id")
    assert (changed.actor_id, changed.parameters["changes"]) == (str(olga.pk), [{"field": "password"}])
    assert (
        Client().post("/accounts/sign-in/", {"username": "operator", "password": NEW}).headers["Location"]
        == "/"
    )


def test_a_link_of_an_email_asks_for_the_second_factor(olga: User) -> None:
    Authenticator.objects.create(user=olga, type=Authenticator.Type.TOTP, data={"secret": "x"})
    client = Client()
    client.post(FORGOTTEN, {"email": olga.email})
    page = client.get(link_in(letter())).headers["Location"]
    answer = client.post(page, {"password1": NEW, "password2": NEW})
    assert "second-factor" in answer.headers["Location"]
    assert not SignIn.objects.filter(user=olga).exists()


@pytest.mark.parametrize(("chosen", "left"), [({"end_tokens": "on"}, 0), ({}, 1)])
def test_a_forgotten_password_ends_tokens_unless_deselected(
    chosen: dict[str, str], left: int, olga: User
) -> None:
    expires = timezone.now() + timedelta(days=1)
    token_make(user=olga, name="night", scopes=[Scope.READ], expires_at=expires, actor=olga)
    client = Client()
    client.post(FORGOTTEN, {"email": "olga@lab.example"})
    page = client.get(link_in(letter())).headers["Location"]
    box = re.search("<input[^>]*end_tokens[^>]*>", client.get(page).content.decode())
    assert box
    assert "checked" in box[0]
    assert client.post(page, {"password1": NEW, "password2": NEW, **chosen}).status_code == 302
    assert Token.objects.count() == left


def test_a_mistyped_address_does_not_get_the_account(olga: User, signed_in: Callable[[User], Client]) -> None:
    client = signed_in(olga)
    client.post("/accounts/again/", {"password": PASSWORD})
    client.post("/accounts/email/", {"action_add": "", "email": "someone-else@lab.example"})
    letter()
    Client().post(FORGOTTEN, {"email": "someone-else@lab.example"})
    Client().post(FORGOTTEN, {"email": "olga@lab.example"})
    assert letter(2).to == ["olga@lab.example"]  # e-mails are sent in order


def test_a_user_name_that_is_anothers_address_locks_nobody_out(olga: User) -> None:
    User.objects.create_user("olga@lab.example", password="not the one of Olga")
    answer = Client().post("/accounts/sign-in/", {"username": "olga@lab.example", "password": PASSWORD})
    assert answer.headers["Location"] == "/"


def test_nobody_learns_which_addresses_there_are(olga: User) -> None:
    known, unknown = (
        Client().post(FORGOTTEN, {"email": address}) for address in ("olga@lab.example", "x@lab.example")
    )
    assert (known.status_code, known.headers["Location"]) == (
        unknown.status_code,
        unknown.headers["Location"],
    )
    assert letter().to == ["olga@lab.example"]
    assert len(mail.outbox) == 1


def test_one_address_gets_few_links_and_a_class_gets_all(olga: User) -> None:
    for number in range(30):
        User.objects.create_user(f"student-{number}", f"student-{number}@lab.example")
        assert Client().post(FORGOTTEN, {"email": f"student-{number}@lab.example"}).status_code == 302
    statuses = [Client().post(FORGOTTEN, {"email": "olga@lab.example"}).status_code for _ in range(4)]
    assert statuses == [302, 302, 302, 429]


def test_a_mail_server_that_hangs_delays_no_page(
    olga: User, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emails, "AGAIN_S", ())  # a later try would reach another test's mailbox
    settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    with socket.create_server(("127.0.0.1", 0)) as server:  # accepts connections, sends nothing
        settings.EMAIL_HOST, settings.EMAIL_PORT = server.getsockname()[:2]
        begun_s = time.monotonic()
        assert Client().post(FORGOTTEN, {"email": "olga@lab.example"}).status_code == 302
        assert time.monotonic() - begun_s < 5.0


def test_an_address_changes_when_its_link_is_opened(
    olga: User, observer: User, signed_in: Callable[[User], Client]
) -> None:
    client = signed_in(olga)
    page = "/accounts/email/"
    asked = client.post(page, {"action_add": "", "email": "new@lab.example"}).headers["Location"]
    assert asked.startswith("/accounts/again/")
    client.post(asked, {"password": PASSWORD})  # then the change continues
    olga.refresh_from_db()
    assert olga.email == "olga@lab.example"
    assert letter().to == ["new@lab.example"]
    assert "new@lab.example waits for its link" in client.get("/accounts/").content.decode()
    link = link_in(mail.outbox[0])
    assert Client().get(link).status_code == 200  # a scanner of e-mails changes nothing
    olga.refresh_from_db()
    assert olga.email == "olga@lab.example"
    assert client.post(link).status_code == 302
    olga.refresh_from_db()
    assert olga.email == "new@lab.example"
    changed = Record.objects.filter(kind="account.change").latest("id")
    assert (changed.actor_id, changed.parameters["changes"]) == (str(olga.pk), [{"field": "email"}])
    assert 'class="badge">verified' in client.get("/accounts/").content.decode()


def test_an_address_that_was_taken_meanwhile_is_refused(
    olga: User, observer: User, signed_in: Callable[[User], Client]
) -> None:
    client = signed_in(olga)
    client.post("/accounts/again/", {"password": PASSWORD})
    client.post("/accounts/email/", {"action_add": "", "email": "new@lab.example"})
    link = link_in(letter())
    observer.email = "new@lab.example"
    observer.save()
    assert "another account has this e-mail address" in client.post(link, follow=True).content.decode()
    olga.refresh_from_db()
    assert olga.email == "olga@lab.example"
    again = client.post("/accounts/email/", {"action_add": "", "email": "new@lab.example"})
    assert again.status_code == 302  # the same answer as for an unused address


def test_staff_changing_an_address_ends_its_verification(olga: User) -> None:
    EmailAddress.objects.create(user=olga, email=olga.email, verified=True, primary=True)
    olga.email = "other@lab.example"
    olga.save()
    assert not EmailAddress.objects.filter(user=olga).exists()


def test_wrong_passwords_before_a_change_count_too(olga: User, signed_in: Callable[[User], Client]) -> None:
    client = signed_in(olga)
    for _ in range(10):
        client.post("/accounts/again/", {"password": "wrong"})
    answer = client.post("/accounts/again/", {"password": PASSWORD}).content.decode()
    assert "Too many failed attempts" in answer
