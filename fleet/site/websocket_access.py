"""Access to WebSockets: only for signed-in people, and only from the console's own pages.

Browsers send cookies with a WebSocket from any page, so the origin of the page is checked.
"""

from __future__ import annotations

import logging
from typing import Any

from channels.auth import AuthMiddlewareStack
from channels.db import database_sync_to_async
from django.conf import settings
from django.http.request import split_domain_port, validate_host

from fleet.accounts.sign_in.second_factor import is_missing
from teleop.live.message_socket import CloseCode

logger = logging.getLogger(__name__)


class SameOrigin:
    """Accepts only pages of the console itself and of `FLEET_ORIGINS`; others get 403.

    A missing Origin and `null` (a sandboxed frame, a file) are refused too.
    """

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        """Run the ASGI application."""
        if origin_allowed(scope["headers"]):
            return await self._inner(scope, receive, send)
        logger.warning("WebSocket %r refused: its page does not belong to the console.", scope["path"])
        await receive()  # websocket.connect
        return await send({"type": "websocket.close"})  # before it was accepted: 403


class SignedIn:
    """Accepts signed-in people, staff with the second factor that they need.

    Others get close code 4401, on which a page can act.
    """

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> Any:
        """Run the ASGI application."""
        reason = "Sign in first."
        if scope["user"].is_authenticated:
            if not await database_sync_to_async(is_missing)(scope["user"]):
                return await self._inner(scope, receive, send)
            reason = "Set up your second factor first, on the page Your account."
        await receive()  # websocket.connect
        await send({"type": "websocket.accept"})
        return await send({"type": "websocket.close", "code": CloseCode.SIGNED_OUT, "reason": reason})


def guarded(inner: Any) -> Any:
    """Wrap an application in all access checks: origin, then person."""
    return SameOrigin(AuthMiddlewareStack(SignedIn(inner)))


def origin_allowed(headers: list[tuple[bytes, bytes]]) -> bool:
    """Return whether the handshake's Origin equals the console's own, by its Host header, or is a trusted one."""
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
