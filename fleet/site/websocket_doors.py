"""Who may open a WebSocket: signed-in people, from pages of ours.

Browsers send cookies with a WebSocket from any page: the page's origin tells ours from theirs.
"""

from __future__ import annotations

import logging
from typing import Any

from channels.auth import AuthMiddlewareStack
from django.conf import settings
from django.http.request import split_domain_port, validate_host

from teleop.live.socket import CloseCode

logger = logging.getLogger(__name__)


class SameOrigin:
    """Lets through only pages of the console itself and of `FLEET_ORIGINS`; the others get 403.

    A missing Origin and `null` (a sandboxed frame, a file) are foreign as well.
    """

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        """The ASGI application."""
        if origin_allowed(scope["headers"]):
            return await self._inner(scope, receive, send)
        logger.warning("WebSocket %r refused: its page is not one of ours", scope["path"])
        await receive()  # websocket.connect
        return await send({"type": "websocket.close"})  # before it was accepted: 403


class SignedIn:
    """Lets through signed-in people. The others are told so by close code 4401, which a page can act on."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        """The ASGI application."""
        if scope["user"].is_authenticated:
            return await self._inner(scope, receive, send)
        await receive()  # websocket.connect
        await send({"type": "websocket.accept"})
        return await send(
            {"type": "websocket.close", "code": CloseCode.SIGNED_OUT, "reason": "Sign in first."}
        )


def guarded(inner: Any) -> Any:
    """Every door of a WebSocket, in order: whose page, which person."""
    return SameOrigin(AuthMiddlewareStack(SignedIn(inner)))


def origin_allowed(headers: list[tuple[bytes, bytes]]) -> bool:
    """Whether the handshake's Origin is the console's own, by its Host header, or a trusted one."""
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
