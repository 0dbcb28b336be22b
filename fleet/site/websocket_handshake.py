"""Access to WebSockets: for signed-in people, only from the console's own pages; and for programs with a token.

Browsers send cookies with a WebSocket from any page, so the origin of the page is checked. A program sends
its token in the header Authorization, which a page in a browser cannot set. A program needs no origin unless
it also sends a cookie.

At a program's door (`DOORS`) no cookie counts, so pages of any origin may connect: with a token, or with a ticket in
the address. A client that brings neither may still sign in with its first message.

Django judges handshakes on one thread. So handshakes wait in turns, fair per person, and those that no valid session
or token signs have a turn of their own: whatever strangers send, people and programs do not wait for it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import AsyncExitStack
from functools import partial
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs

from channels.auth import AuthMiddlewareStack
from channels.db import database_sync_to_async
from django.conf import settings
from django.http import parse_cookie
from django.http.request import split_domain_port, validate_host

from fleet.accounts.sign_in.second_factor import is_missing, require_for_token
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import TokenInvalid, key_of, token_of
from fleet.accounts.tokens.tickets import ticket_use
from fleet.base.web.network_addresses import network_of
from fleet.server.credentials import Credential
from fleet.server.turns import Turns
from teleop.live.consumers.message_socket import CloseCode
from teleop.stop.rights import rights

logger = logging.getLogger(__name__)


PEOPLE_AT_ONCE = 3
STRANGERS_AT_ONCE = 1
DOORS = ("/rosbridge/", "/foxglove/")  # begins of their addresses
_JUDGED = "fleet.judged"  # in the scope: ends the turn
_STRANGER = "fleet.stranger"  # in the scope: begins another turn of a stranger


class InTurn:
    """Judge handshakes with `guards(inner)`, in turn. The turn ends before `inner` runs the connection."""

    def __init__(self, guards: Callable[[Any], Any], inner: Any) -> None:
        self._guarded = guards(self._run)
        self._inner = inner
        self._people = Turns(PEOPLE_AT_ONCE)
        self._strangers = Turns(STRANGERS_AT_ONCE)

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        scope = {**scope, "path": f"/{scope['path'].lstrip('/')}"}  # as the router reads it
        credential = _token_in(scope["headers"]) if is_door(scope) else _credential(scope["headers"])
        right = await rights.ask(credential) if credential else None
        address = network_of(str((scope.get("client") or [""])[0]))
        stranger = partial(self._strangers.turn, (address,))
        async with AsyncExitStack() as turn:
            await turn.enter_async_context(
                stranger() if right is None else self._people.turn((right.person.pk,))
            )
            return await self._guarded({**scope, _JUDGED: turn.aclose, _STRANGER: stranger}, receive, send)

    async def _run(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        await scope[_JUDGED]()
        return await self._inner(scope, receive, send)


class SameOrigin:
    """Accept only pages of the console itself and of `FLEET_ORIGINS`; others get 403.

    A missing Origin and `null` (a sandboxed frame, a file) are refused, too.
    """

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        if origin_allowed(scope["headers"]):
            return await self._inner(scope, receive, send)
        logger.warning("WebSocket %r refused: its page does not belong to the console.", scope["path"])
        await receive()  # websocket.connect
        return await send({"type": "websocket.close"})  # before accepting, this sends 403


class SignedIn:
    """Accept signed-in people; staff only with the second factor that they need.

    Others get the close code 4401, which pages understand.
    """

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        reason = "Sign in first."
        if scope["user"].is_authenticated:
            if not await database_sync_to_async(is_missing)(scope["user"]):
                return await self._inner(scope, receive, send)
            reason = "Set up your second factor first, on the page Your account."
        await receive()  # websocket.connect
        await send({"type": "websocket.accept"})
        return await send({"type": "websocket.close", "code": CloseCode.SIGNED_OUT, "reason": reason})


class Programs:
    """Sign programs in by their tokens; pass all other connections to `people`."""

    def __init__(self, inner: Any, people: Any) -> None:
        self._inner = inner
        self._people = people

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        credential = _credential(scope["headers"])
        if credential is None or not credential.is_token:
            return await self._people(scope, receive, send)
        try:
            token = await database_sync_to_async(_token)(credential.text)
        except TokenInvalid as error:
            await receive()  # websocket.connect
            await send({"type": "websocket.accept"})
            return await send(
                {"type": "websocket.close", "code": CloseCode.SIGNED_OUT, "reason": error.text[:120]}
            )
        # This WebSocket shows and stops all robots, also those that the token does not include
        if scope["path"].startswith("/ws/fleet/"):
            return await self._people(scope, receive, send)
        return await self._inner({**scope, **_signed_in(token)}, receive, send)


class Doors:
    """Sign clients of programs' doors in by token or ticket; pass connections of other addresses to `others`.

    In a door's scope, `sign_in` signs in later by a token's text; it raises `TokenInvalid`. `refused` is the
    `TokenInvalid` of a token or ticket: the door says so in its own protocol.
    """

    def __init__(self, inner: Any, others: Any) -> None:
        self._inner = inner
        self._others = others

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        if not is_door(scope):
            return await self._others(scope, receive, send)
        found: dict[str, Any] = {"sign_in": partial(self._sign_in, scope[_STRANGER])}
        try:
            if ticket := parse_qs(scope["query_string"].decode("latin-1")).get("ticket"):
                found |= await database_sync_to_async(_by_ticket)(ticket[0], scope["path"])
            elif (credential := _token_in(scope["headers"])) is not None:
                found |= _signed_in(await database_sync_to_async(_token)(credential.text))
        except TokenInvalid as error:
            found["refused"] = error
        return await self._inner({**scope, **found}, receive, send)

    async def _sign_in(self, turn: Callable[[], Any], text: str) -> dict[str, Any]:
        """Return what a token adds to the scope. Raises `TokenInvalid`."""
        async with turn():
            return _signed_in(await database_sync_to_async(_token)(text))


def is_door(scope: dict[str, Any]) -> bool:
    """Return whether this connection comes to a door of programs."""
    path: str = scope["path"]
    return path.startswith(DOORS)


def _by_ticket(text: str, path: str) -> dict[str, Any]:
    """Return what a ticket adds to the scope. Raises `TokenInvalid`."""
    _, door, robot, *_ = path.split("/")
    ticket = ticket_use(text, robot=robot, door=door)
    if ticket.token is not None:
        require_for_token(ticket.token)
        return _signed_in(ticket.token)
    return {"user": ticket.user, "session": SimpleNamespace(session_key=ticket.session_key)}


def _signed_in(token: Token) -> dict[str, Any]:
    """Return the scope of a program. With its session's key, the rights of the connection are checked later."""
    session = SimpleNamespace(session_key=key_of(token))
    return {"user": token.user, "token": token, "session": session}


def _token(text: str) -> Token:
    """Return a program's token. Raises `TokenInvalid`."""
    token = token_of(text)
    require_for_token(token)
    return token


def guarded(inner: Any) -> Any:
    """Wrap an application in all access checks: origin and person, or a program's token."""
    return InTurn(
        lambda run: Doors(run, Programs(run, SameOrigin(AuthMiddlewareStack(SignedIn(run))))), inner
    )


def _credential(headers: list[tuple[bytes, bytes]]) -> Credential | None:
    """Return what signs a handshake: the cookie of a session, else a program's token. Nobody has checked it yet."""
    if cookies := _values(headers, b"cookie"):
        key = parse_cookie("; ".join(cookies)).get(settings.SESSION_COOKIE_NAME)
        return Credential(key) if key else None
    return _token_in(headers)


def _token_in(headers: list[tuple[bytes, bytes]]) -> Credential | None:
    """Return a program's token. Nobody has checked it yet."""
    [header, *_] = [*_values(headers, b"authorization"), ""]
    scheme, _, text = header.partition(" ")
    return Credential(text.strip(), is_token=True) if scheme.lower() == "bearer" else None


def origin_allowed(headers: list[tuple[bytes, bytes]]) -> bool:
    """Return whether the handshake's Origin is trusted, or is the console's own, by the Host header."""
    origins = _values(headers, b"origin")
    hosts = _values(headers, b"host")
    if len(origins) != 1 or len(hosts) != 1:
        return False
    if origins[0] in settings.FLEET_ORIGINS:
        return True
    domain, _port = split_domain_port(hosts[0])
    own = f"{'https' if settings.FLEET_TLS else 'http'}://{hosts[0]}"
    return validate_host(domain, settings.ALLOWED_HOSTS) and origins[0].lower() == own.lower()


def _values(headers: list[tuple[bytes, bytes]], name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in headers if key.lower() == name]
