"""Checks of each API request: token, browser session, body. Each refusal has its code."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.conf import settings
from django.test import Client
from django.utils import timezone, translation

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import token_end, token_make
from fleet.audit.models import Record
from robots.registry.models import Robot
from teleop.api.v1.framework import rates
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db(transaction=True)

CONTROL = "/api/v1/robots/tiago-1/control"
VELOCITY = "/api/v1/robots/tiago-1/velocity"


@pytest.fixture
def made(operator: User) -> Callable[..., tuple[Token, dict[str, str]]]:
    """Make a token of the operator; returns it with the headers of a request."""

    def make(*scopes: Scope, **options: Any) -> tuple[Token, dict[str, str]]:
        expires = options.pop("expires_at", timezone.now() + timedelta(days=1))
        token, text = token_make(
            user=operator, name="test", scopes=scopes, expires_at=expires, actor=operator, **options
        )
        return token, {"Authorization": f"Bearer {text}"}

    return make


def post(headers: dict[str, str], body: Any, path: str = VELOCITY, client: Client | None = None) -> Any:
    raw = body if isinstance(body, bytes) else json.dumps(body).encode()
    return (client or Client()).post(path, raw, content_type="application/json", headers=headers)


def test_a_token_that_is_wrong_ended_or_expired_opens_nothing(
    robot: Robot, made: Any, operator: User
) -> None:
    token, headers = made(Scope.READ)
    assert Client().get("/api/v1/robots", headers=headers).status_code == 200
    assert Token.objects.get().used_at is not None
    token_end(token=token, actor=operator)
    _, old = made(Scope.READ, expires_at=timezone.now() - timedelta(seconds=1))
    _, closed = made(Scope.READ)
    for given, code in (
        (headers, "token_invalid"),
        (old, "token_expired"),
        ({"Authorization": "Bearer "}, "token_invalid"),
        ({"Authorization": "Bearer fleet_ü"}, "token_invalid"),
        ({"Authorization": "Basic b2xnYTp4"}, "signed_out"),
        ({}, "signed_out"),
    ):
        answer = Client().get("/api/v1/robots", headers=given)
        assert (answer.status_code, answer.json()["code"]) == (401, code)
        assert answer["Content-Type"] == "application/problem+json"
        assert answer["WWW-Authenticate"].startswith("Bearer")
    User.objects.filter(pk=operator.pk).update(is_active=False)
    assert Client().get("/api/v1/robots", headers=closed).json()["code"] == "account_inactive"


def test_a_token_opens_its_scopes_and_robots_only(
    robot: Robot, other_robot: Robot, made: Any, operator: User
) -> None:
    other_robot.roles.create(user=operator, role="operator")
    _, headers = made(Scope.SPEAK, robots=[robot.pk])
    refused = post(headers, {"forward_mps": 0.1})
    assert (refused.status_code, refused.json()["figures"]) == (403, {"scope": "drive"})
    assert Client().get("/api/v1/robots", headers=headers).json()["code"] == "scope_missing"
    refused = post(made(Scope.BOOK)[1], {}, CONTROL)
    assert refused.json()["figures"] == {"scope": "drive speak motions topics"}
    _, headers = made(Scope.READ, robots=[robot.pk])
    listed = Client().get("/api/v1/robots", headers=headers).json()["robots"]
    assert [one["slug"] for one in listed] == [robot.slug]
    assert Client().get(f"/api/v1/robots/{other_robot.slug}", headers=headers).status_code == 404
    stop = Client().post(f"/api/v1/robots/{other_robot.slug}/stop", headers=headers)
    assert stop.status_code == 404


def test_a_request_with_a_cookie_is_held_to_its_origin(robot: Robot, made: Any, operator: User) -> None:
    _, headers = made(Scope.DRIVE)
    browser = Client(enforce_csrf_checks=True)
    browser.login(username=operator.username, password=PASSWORD)
    assert settings.SESSION_COOKIE_NAME in browser.cookies
    for given in ({}, headers):
        refused = post(given, {}, CONTROL, browser)
        assert (refused.status_code, refused.json()["rule"]) == (403, "account"), given
    assert post(headers, {}, CONTROL).json()["code"] == "no_programs"  # without a cookie: passed


@pytest.mark.parametrize(
    ("body", "status", "code", "words"),
    [
        (b'{"forward_mps": 0.1', 400, "not_json", "from line 1, column 20 on"),
        (b'{"forward_mps": "fast"}', 400, "invalid", "forward_mps: Expected a number"),
        (b'{"forward_mps": 1e400}', 400, "", ""),
        (b'{"forward_mps": NaN}', 400, "", ""),
        (b'{"seconds": 0.6}', 400, "invalid", "seconds: Expected a number"),
        (b'{"forwards": 0.1}', 400, "invalid", "forwards"),
        (b'{"forward_mps": 0.1, "forward_mps": 0.2}', 400, "duplicate_field", "forward_mps"),
        (b'{"\\ud800": 1, "\\ud800": 2}', 400, "duplicate_field", "?"),
        (b'{"a": "\\u0000"}', 400, "invalid", "NUL"),
        (b'{"a\\u0000": 1}', 400, "invalid", "NUL"),
        (b"[]", 400, "invalid", "Expected an object, got a list"),
        ('{"a": "ü"}'.encode("latin-1"), 400, "not_utf8", "UTF-8"),
        (b'{"a":' + b"[" * 40 + b"]" * 40 + b"}", 400, "too_deep", "levels"),
        (b'{"a":' + b"[" * 30000 + b"]" * 30000 + b"}", 400, "too_deep", "levels"),
        (b'{"a": "' + b"x" * 70000 + b'"}', 413, "too_large", "70"),
    ],
)
def test_a_body_that_does_not_fit_is_named(
    body: bytes, status: int, code: str, words: str, robot: Robot, made: Any
) -> None:
    answer = post(made(Scope.DRIVE)[1], body)
    assert answer.status_code == status
    assert answer.json()["code"] == code or not code
    assert words in answer.json()["detail"]
    assert "control.take" not in Record.objects.values_list("kind", flat=True)


def test_a_field_that_is_there_twice_is_found_in_no_time(robot: Robot, made: Any) -> None:
    headers, names = made(Scope.DRIVE)[1], [f"{number:x}" for number in range(6500)]
    body = ",".join(f'"{name}":1' for name in [*names, names[-1]])
    began_s = time.thread_time()
    assert post(headers, f"{{{body}}}".encode()).json()["code"] == "duplicate_field"
    assert time.thread_time() - began_s < 0.3  # the time once grew with the square of the number


def test_other_types_and_methods_get_words(robot: Robot, made: Any) -> None:
    headers = made(Scope.READ, Scope.DRIVE)[1]
    form = Client().post(VELOCITY, {"forward_mps": 0.1}, headers=headers)
    assert (form.status_code, form.json()["code"]) == (415, "unsupported_media_type")
    xml = Client().get("/api/v1/robots", headers={**headers, "Accept": "application/xml"})
    assert (xml.status_code, xml.json()["code"]) == (406, "not_acceptable")
    put = Client().put(VELOCITY, b"{}", content_type="application/json", headers=headers)
    assert (put.status_code, put["Allow"]) == (405, "POST, OPTIONS")
    head = Client().head("/api/v1/robots", headers=headers)
    assert (head.status_code, head.content) == (200, b"")
    assert Client().options("/api/v1/robots", headers=headers)["Allow"] == "GET, HEAD, OPTIONS"


def test_a_429_says_when_to_ask_again(robot: Robot, made: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rates, "BURST", 3.0)
    monkeypatch.setattr(rates, "PER_S", 0.001)
    headers, other = made(Scope.READ)[1], made(Scope.READ)[1]
    answers = [Client().get("/api/v1/robots", headers=headers) for _ in range(5)]
    assert [answer.status_code for answer in answers[:3]] == [200] * 3
    assert (answers[-1].status_code, answers[-1].json()["code"]) == (429, "too_often")
    assert int(answers[-1]["Retry-After"]) >= 1
    assert Client().get("/api/v1/robots", headers=other).status_code == 200
    # A stop is never limited
    assert Client().post(f"/api/v1/robots/{robot.slug}/stop", headers=headers).status_code == 202


def test_the_reference_says_to_other_readers_that_it_is_in_english(
    client: Client, operator: User, settings: Any
) -> None:
    client.force_login(operator)
    settings.LANGUAGES = [*settings.LANGUAGES, ("es", "Español")]
    with translation.override(None):  # restores the language, which a page sets for its thread
        pages = [
            client.get("/api/v1/reference", headers={"Accept-Language": language}).content.decode()
            for language in ("en", "es")
        ]
    notes = [page.count('class="quiet"') for page in pages]
    assert notes == [1, 2]
