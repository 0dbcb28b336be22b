"""Secrets in the log are cut to their first characters."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from typing import Any

import pytest
from django.conf import settings
from django.urls import URLPattern, get_resolver

from fleet.base.logs import Redacted, redacted

SECRET = "4sX9kq7-Zt_2vB8nQw"
# Parameters of addresses that are secrets; the others name something.
SECRETS = {"code", "token", "key"}
NAMES = {
    *(
        "slug",
        "session_id",
        "number",
        "uuid",
        "booking_id",
        "period_id",
        "camera",
        "error",
        "person_id",
        "token_id",
        "turn_id",
        "invitation_id",
        "holiday_id",
        "change_id",
        "offer_id",
        "series",
    ),
    *(
        "webhook_id",
        "sign_in_id",
        "username",
        "qualification",
        "digest",
        "use",
        "name",
        "package",
        "path",
        "address",
        "file",
        "recording_id",
    ),
    *(
        "provider_id",
        "uidb36",
        "pk",
        "app_label",
        "url",
        "content_type_id",
        "object_id",
        "id",
        "page",
        "picture",
    ),
}


def _patterns(resolver: Any = None, before: str = "") -> Iterator[str]:
    for one in (resolver or get_resolver()).url_patterns:
        route = before + (getattr(one.pattern, "_route", None) or one.pattern.regex.pattern.strip("^$"))
        yield from [route] if isinstance(one, URLPattern) else _patterns(one, route)


def test_no_secret_of_an_address_is_logged() -> None:
    parameter, seen = re.compile(r"<(?:[a-z]+:)?([a-z_0-9]+)>|\(\?P<([a-z_0-9]+)>.*?\)(?=/|-|$)"), set[str]()
    for route in _patterns():
        if route.startswith("admin/"):
            continue  # keys of rows
        names = {first or second for first, second in parameter.findall(route)}
        seen |= names
        if names & SECRETS:
            said = parameter.sub(lambda found: SECRET if (found[1] or found[2]) in SECRETS else "1", route)
            line = redacted(f"Not Found: /{said}")
            assert SECRET not in line, route
            assert SECRET[:4] in line, route
    assert seen <= SECRETS | NAMES, f"say which are secrets: {seen - SECRETS - NAMES}"


@pytest.mark.parametrize(
    "said",
    [
        f"Authorization: Bearer {SECRET}",
        f"a token fleet_{SECRET}{SECRET}",
        f"whsec_{SECRET}",
        f"fleet_session_8000={SECRET}; other=1",
        f"csrftoken={SECRET}",
        f"Not Found: /Join//{SECRET}",
        f"Not Found: /bookings//ical/{SECRET}.ICS",
        f"/lichtblick/?ds.url=ws%3A%2F%2Fhere%2Ffoxglove%2Ftiago-1%3Fticket%3D{SECRET}",
        f"/accounts/oidc/lab/login/callback/?state=ok&code={SECRET}",
    ],
)
def test_secrets_of_headers_and_queries_are_cut(said: str) -> None:
    assert SECRET not in redacted(said)


def test_a_traceback_is_cut_and_plain_lines_stay() -> None:
    try:
        raise ValueError(f"/join/{SECRET}")
    except ValueError as error:
        record = logging.LogRecord("x", logging.ERROR, "", 1, "failed: %s", ("/robots/tiago-1/",), None)
        record.exc_info = (type(error), error, error.__traceback__)
    line = Redacted("{message}", style="{").format(record)
    assert "/robots/tiago-1/" in line
    assert "Traceback" in line
    assert SECRET not in line
    assert settings.LOGGING["formatters"]["line"]["()"] is Redacted
    assert (
        redacted("FLEET_HOSTS is not set; fleet.server: 3 keys")
        == "FLEET_HOSTS is not set; fleet.server: 3 keys"
    )
