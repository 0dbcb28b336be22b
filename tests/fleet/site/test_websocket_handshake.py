"""Access to WebSockets: signed-in people, from the console's own pages."""

import asyncio

import pytest
from channels.db import database_sync_to_async
from channels.routing import URLRouter
from channels.testing import WebsocketCommunicator
from django.contrib.sessions.models import Session
from django.urls import path

from fleet.site.asgi import application
from fleet.site.websocket_handshake import SameOrigin, guarded
from teleop.live.consumers.message_socket import CloseCode
from tests.fleet.support import websocket_answer

pytestmark = pytest.mark.django_db(transaction=True)


async def _open_door(scope, receive, send):
    """Accept every connection that passes the checks."""
    await receive()
    await send({"type": "websocket.accept"})
    await send({"type": "websocket.send", "text": f"hello {scope['user'].username}"})
    await receive()


BEHIND_THE_DOORS = guarded(URLRouter([path("ws/test/", _open_door)]))


@pytest.fixture
def headers(operator, signed_in, websocket_headers):
    """The headers of the operator's browser on one of the console's pages."""
    return dict(websocket_headers(signed_in(operator)))


async def _answer(headers, app=BEHIND_THE_DOORS):
    return await websocket_answer(app, "/ws/test/", headers)


FORBIDDEN = {"type": "websocket.close"}  # without an accept before it: HTTP 403


async def test_signed_in_person_on_own_page_is_accepted(headers):
    assert (await _answer(headers))["text"] == "hello operator"


@pytest.mark.parametrize(
    "origin",
    [
        b"null",
        b"",
        b"http://evil.example",
        b"http://testserver.evil.example",
        b"http://testserver:8000",
        b"https://testserver",
        b"file://",
        b"http://testserver@evil.example",
    ],
)
async def test_foreign_page_with_the_cookie_is_refused(headers, origin):
    assert await _answer(headers | {b"origin": origin}) == FORBIDDEN
    assert await _answer(headers | {b"origin": origin}, application) == FORBIDDEN


async def test_missing_origin_is_refused(headers):
    del headers[b"origin"]
    assert await _answer(headers) == FORBIDDEN


async def test_two_origins_are_refused(headers):
    socket = WebsocketCommunicator(
        BEHIND_THE_DOORS, "/ws/test/", headers=[*headers.items(), (b"origin", b"http://evil.example")]
    )
    assert (await socket.connect())[0] is False


async def test_foreign_host_is_refused_even_with_its_origin(headers):
    rebound = {b"host": b"evil.example", b"origin": b"http://evil.example"}
    assert await _answer(headers | rebound) == FORBIDDEN


async def test_trusted_origin_is_accepted(headers, settings):
    settings.FLEET_ORIGINS = ["https://fleet.example:8443"]
    assert (await _answer(headers | {b"origin": b"https://fleet.example:8443"}))["text"] == "hello operator"


async def test_plain_http_page_is_foreign_under_tls(headers, settings):
    settings.FLEET_TLS = True
    assert await _answer(headers) == FORBIDDEN
    assert (await _answer(headers | {b"origin": b"https://testserver"}))["text"] == "hello operator"


async def test_anonymous_page_is_closed_with_4401(headers):
    del headers[b"cookie"]
    answer = await _answer(headers)
    assert (answer["type"], answer["code"]) == ("websocket.close", CloseCode.SIGNED_OUT)
    assert await _answer(headers, application) == answer


async def test_cookie_of_an_ended_session_is_anonymous(headers, operator):
    await database_sync_to_async(Session.objects.all().delete)()
    assert (await _answer(headers))["code"] == CloseCode.SIGNED_OUT


async def test_strangers_are_judged_in_turn_and_people_pass_them(headers, monkeypatch):
    judged, begun = asyncio.Event(), []

    async def slow(self, scope, receive, send):
        if b"cookie" not in dict(scope["headers"]):
            begun.append(scope)
            await judged.wait()
        return await whole(self, scope, receive, send)

    whole = SameOrigin.__call__
    monkeypatch.setattr(SameOrigin, "__call__", slow)
    strangers = [asyncio.ensure_future(_answer({b"origin": b"null"})) for _ in range(5)]
    assert (await _answer(headers))["text"] == "hello operator"
    assert len(begun) == 1
    judged.set()
    assert await asyncio.gather(*strangers) == [FORBIDDEN] * 5
