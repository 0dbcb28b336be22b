"""Who may open a WebSocket: signed-in people, from pages of ours."""

import pytest
from channels.db import database_sync_to_async
from channels.routing import URLRouter
from channels.testing import WebsocketCommunicator
from django.contrib.sessions.models import Session
from django.urls import path

from fleet.site.asgi import application
from fleet.site.websocket_access import guarded
from teleop.live.message_socket import CloseCode

pytestmark = pytest.mark.django_db(transaction=True)


async def _open_door(scope, receive, send):
    """Accepts whoever reaches it."""
    await receive()
    await send({"type": "websocket.accept"})
    await send({"type": "websocket.send", "text": f"hello {scope['user'].username}"})
    await receive()


BEHIND_THE_DOORS = guarded(URLRouter([path("ws/test/", _open_door)]))


@pytest.fixture
def headers(operator, signed_in, websocket_headers):
    """What the operator's browser sends from a page of ours."""
    return dict(websocket_headers(signed_in(operator)))


async def _answer(headers, app=BEHIND_THE_DOORS):
    """What the server says first to a handshake, and to nothing more."""
    socket = WebsocketCommunicator(app, "/ws/test/", headers=list(headers.items()))
    await socket.send_input({"type": "websocket.connect"})
    answer = await socket.receive_output()
    if answer["type"] == "websocket.accept":
        answer = await socket.receive_output()
        await socket.send_input({"type": "websocket.disconnect", "code": 1000})
    await socket.wait()
    return answer


FORBIDDEN = {"type": "websocket.close"}  # without an accept before it: HTTP 403


async def test_a_signed_in_person_from_a_page_of_ours_gets_in(headers):
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
async def test_a_foreign_page_is_refused_although_it_brings_the_cookie(headers, origin):
    assert await _answer(headers | {b"origin": origin}) == FORBIDDEN
    assert await _answer(headers | {b"origin": origin}, application) == FORBIDDEN


async def test_a_missing_origin_is_refused(headers):
    del headers[b"origin"]
    assert await _answer(headers) == FORBIDDEN


async def test_two_origins_are_refused(headers):
    socket = WebsocketCommunicator(
        BEHIND_THE_DOORS, "/ws/test/", headers=[*headers.items(), (b"origin", b"http://evil.example")]
    )
    assert (await socket.connect())[0] is False


async def test_a_host_that_is_not_ours_is_refused_even_if_the_origin_agrees(headers):
    rebound = {b"host": b"evil.example", b"origin": b"http://evil.example"}
    assert await _answer(headers | rebound) == FORBIDDEN


async def test_a_trusted_origin_gets_in(headers, settings):
    settings.FLEET_ORIGINS = ["https://fleet.example:8443"]
    assert (await _answer(headers | {b"origin": b"https://fleet.example:8443"}))["text"] == "hello operator"


async def test_under_tls_a_page_without_it_is_foreign(headers, settings):
    settings.FLEET_TLS = True
    assert await _answer(headers) == FORBIDDEN
    assert (await _answer(headers | {b"origin": b"https://testserver"}))["text"] == "hello operator"


async def test_an_anonymous_page_is_told_to_sign_in_and_closed(headers):
    del headers[b"cookie"]
    answer = await _answer(headers)
    assert (answer["type"], answer["code"]) == ("websocket.close", CloseCode.SIGNED_OUT)
    assert await _answer(headers, application) == answer


async def test_a_cookie_whose_session_has_ended_is_anonymous(headers, operator):
    await database_sync_to_async(Session.objects.all().delete)()
    assert (await _answer(headers))["code"] == CloseCode.SIGNED_OUT
