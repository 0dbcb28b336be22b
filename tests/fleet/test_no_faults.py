"""Every address answers every kind of request without a server error."""

import logging
from itertools import cycle
from uuid import uuid4

import pytest
from django.contrib import admin
from django.contrib.auth import SESSION_KEY
from django.test import Client
from django.urls import URLPattern, get_resolver

from fleet.site.asgi import application
from teleop.live.consumers.message_socket import CloseCode
from tests.fleet.support import websocket_answer

ACCEPTS = [None, "text/html", "q=;;,/"]
BODIES = [
    ("", b""),
    ("application/json", b"{"),
    ("application/json", b'"\xff"'),
    ("application/x-www-form-urlencoded", b"a=%ff&username=%00&password=x&next=//x"),
    ("multipart/form-data", b"no boundary"),
    ("application/xml", b"<a/>"),
    ("text/plain; charset=nonsense", b"\xff"),
]
QUERIES = [
    "",
    "?format=html",
    "?limit=%00&before=x&p=x&o=x&all&e=1&next=//x",
    "?_popup=1&_to_field=x&q=%00%ff",
]
IN_WORDS = {502, 503}  # robot or database unreachable: no fault of the console


# --- HTTP -----------------------------------------------------------------------------------------


def _patterns(resolver, before=()):
    for entry in resolver.url_patterns:
        pieces = (*before, entry.pattern)
        if isinstance(entry, URLPattern):
            yield pieces
        else:
            yield from _patterns(entry, pieces)


def _addresses(robot):
    """Addresses for each URL pattern, of an existing and of a missing object, and whether the object exists."""
    there = {"slug": robot.slug, "uuid": str(robot.pk), "int": "0", "object_id": str(robot.pk), "str": "x"}
    not_there = {"slug": "nowhere", "uuid": str(uuid4()), "int": "9" * 20, "object_id": "_5F_", "str": "%00"}
    unknown = (
        "/nowhere",
        "/nowhere/",
        "/api/v1/nowhere",
        "/api/v1/robots",
        "/admin/nowhere/",
        "/%00",
        "/%ff/",
    )
    found = dict.fromkeys(unknown, False)
    for values in (not_there, there):
        for pieces in _patterns(get_resolver()):
            found["/" + "".join(_filled(piece, values) for piece in pieces)] = values is there
    return dict(sorted(found.items()))


def _filled(pattern, values):
    """Fill a pattern with values; for a regular expression, a text that may match."""
    if not hasattr(pattern, "_route"):
        return values["str"] + "/"
    text = str(pattern)
    for name, converter in pattern.converters.items():
        kind = type(converter).__name__.removesuffix("Converter").lower()
        value = values.get(name) or values.get(kind) or "x"
        text = text.replace(f"<{kind}:{name}>", value).replace(f"<{name}>", value)
    return text


def _requests(address, exists, number):
    """Yield method, Accept header, and whether CSRF is checked: every second time, shifted at each address."""
    few = address.startswith("/admin/") or not exists
    methods = ["GET", "POST"] if few else ["GET", "POST", "PUT", "OPTIONS", "BREW"]
    for turn, method in enumerate(methods, number):
        yield method, ACCEPTS[turn % len(ACCEPTS)], method != "GET" and turn % 2 == 0


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("person", [None, "observer", "staff"])
def test_no_request_fails_at_any_address(person, robot, caplog, request):
    caplog.set_level(logging.ERROR)
    client = Client(raise_request_exception=False)
    bodies, queries = cycle(BODIES), cycle(QUERIES)
    failed = []
    for number, (address, exists) in enumerate(_addresses(robot).items()):
        if person and SESSION_KEY not in client.session:  # the first time, and after sign-out
            client.force_login(request.getfixturevalue(person))
        for method, accept, forged in _requests(address, exists, number):
            kind, body = next(bodies)
            client.handler.enforce_csrf_checks = forged
            headers = {"Accept": accept} if accept else {}
            answer = client.generic(method, address + next(queries), body, kind, headers=headers)
            if answer.status_code >= 500 and answer.status_code not in IN_WORDS:
                failed.append((answer.status_code, method, address, accept, kind, forged, answer.exc_info))
    # Django logs suspicious requests, such as an unknown filter, with a traceback; their answer is 400.
    logged = [record for record in caplog.records if not record.name.startswith("django.security")]
    faults = [
        record.getMessage() for record in logged if record.exc_info or "not recorded" in record.getMessage()
    ]
    assert (failed, faults) == ([], [])


@pytest.mark.django_db(transaction=True)
def test_the_walk_meets_every_kind_of_address(robot):
    addresses = _addresses(robot)
    met = {"/", f"/api/v1/robots/{robot.slug}/stop/", "/api/v1/stop/", "/your-data/export/"}
    assert met <= {address for address, exists in addresses.items() if exists}
    for model in admin.site._registry:
        assert f"/admin/{model._meta.app_label}/{model._meta.model_name}/" in addresses


# --- WebSockets ---------------------------------------------------------------------------------------

UNKNOWN = [
    "/",
    "/ws/",
    "/ws/nowhere/",
    "/ws/robots/",
    "/ws/fleet",
    "/ws/robots/%00/",
    "/ws/robots/a b/topics/",
    "//",
]


async def _closed_with(path, headers):
    answer = await websocket_answer(application, path, headers)
    assert answer["type"] == "websocket.close"
    return answer.get("code"), answer.get("reason")


@pytest.fixture
def headers(observer, signed_in, websocket_headers):
    """Headers of the observer's browser on a page of the console."""
    return dict(websocket_headers(signed_in(observer)))


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("path", UNKNOWN)
async def test_a_websocket_to_an_unknown_address_is_closed_in_words(path, headers):
    signed_out = headers | {b"cookie": b""}
    foreign = headers | {b"origin": b"http://evil.example"}
    assert await _closed_with(path, headers) == (
        CloseCode.NOT_FOUND,
        "There is no such address.",
    )
    assert await _closed_with(path, signed_out) == (CloseCode.SIGNED_OUT, "Sign in first.")
    assert await _closed_with(path, foreign) == (None, None)  # closed before acceptance: 403
