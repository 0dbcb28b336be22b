"""Limits of a request, before any view handles it.

The server does not know yet which person sent it: a session cookie is a hint, not a proof. Requests with a
session cookie may have a larger body, because admin forms need it. The size of all bodies together is
limited, too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from fleet.base.web.error_pages import error_page
from robots.shared.sentences import Sentence, say

URL_BYTES = 4096
HEAD_BYTES = 16384  # request line and headers
HEADERS = 100
BODY_BYTES = 64 * 1024  # without session cookie: a sign-in form has less than 1 KiB
SIGNED_IN_BODY_BYTES = 4 * 1024 * 1024  # for an admin form: Django itself accepts 2.5 MB
STOP_BODY_BYTES = 16 * 1024  # what is kept of a stop's body: a form's CSRF token stands at its beginning
BODIES_BYTES = 64 * 1024 * 1024  # all bodies in memory together
BODIES_OF_ADDRESS_BYTES = BODIES_BYTES // 2  # one stranger must not keep all others from signing in

UNHANDLED_BYTES = 64 * 1024  # received bytes of one connection that wait for their turn; then reading pauses

HEAD_S = 10.0  # from the first byte of a request, or from connecting, to the end of its headers
BODY_S = 60.0  # from the end of the headers to the end of the body
IDLE_S = 60.0  # between two requests
UNREAD_S = 60.0  # the longest time in which a client may read nothing of a response

# A class of 60 students may share one address. A browser opens six connections, and some WebSockets per page.
CONNECTIONS = 2000
# Connections that the kernel holds until they are accepted; beyond it, clients wait for a second
BACKLOG = 4096
CONNECTIONS_OF_ADDRESS = 1000
# With `REQUESTS`, fewer than `CONNECTIONS`: so a new connection always finds one that may close
WEBSOCKETS = 1500
WEBSOCKETS_OF_ADDRESS = 600
REQUESTS = 400  # requests that wait for their responses
REQUESTS_OF_ADDRESS = 200
# Stops of people who may not stop that robot, which the pages process answers; others wait
STRANGERS_AT_ONCE = 2

# One message of a WebSocket: pages send 8 KiB at most; the console answers larger messages with a refusal
MESSAGE_BYTES = 64 * 1024
HANDSHAKE_BYTES = 16384  # bytes that a WebSocket may send before it is accepted
UNREAD_BYTES = 256 * 1024  # of one WebSocket, while the console handles older ones; then reading pauses
MESSAGE_COST_BYTES = 256  # of these, for each message that waits: about a thousand messages wait at most
PIECE_BYTES = 4096  # of a WebSocket's bytes, handled before the next look at these limits


@dataclass(eq=False)
class HttpRefusal(Exception):
    """A request that is not accepted. Its response is a problem document (RFC 9457), like those of the API."""

    status: int
    reason: str
    code: str
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)
    retry_after_s: int | None = None

    def response(self) -> bytes:
        """Return the whole HTTP response. The connection closes after it."""
        refusal = {"code": self.code, "text": self.text, "rule": "limits", "figures": dict(self.figures)}
        problem = {
            "type": error_page(self.code),
            "title": self.reason,
            "status": self.status,
            "detail": self.text,
        }
        parts = self.text.parts if isinstance(self.text, Sentence) else [self.text]
        said = {"said": {"text": parts, "detail": parts}}
        body = json.dumps({**problem, **refusal, **said, "refusals": [{**refusal, **said}]}).encode()
        retry = f"Retry-After: {self.retry_after_s}\r\n" if self.retry_after_s else ""
        head = (
            f"HTTP/1.1 {self.status} {self.reason}\r\nContent-Type: application/problem+json\r\n"
            f"Content-Length: {len(body)}\r\n{retry}Cache-Control: no-store\r\nConnection: close\r\n\r\n"
        )
        return head.encode() + body


def url_too_long() -> HttpRefusal:
    """Return the refusal of a request line with more than `URL_BYTES`."""
    text = say("Not done: the address is longer than {most} bytes.", most=URL_BYTES)
    return HttpRefusal(414, "URI Too Long", "url_too_long", text, {"most_bytes": URL_BYTES})


def head_too_large() -> HttpRefusal:
    """Return the refusal of more than `HEADERS` headers, or more than `HEAD_BYTES` of headers."""
    text = say(
        "Not done: the request has more than {headers} headers or {bytes} bytes of them.",
        headers=HEADERS,
        bytes=HEAD_BYTES,
    )
    figures = {"most_bytes": HEAD_BYTES, "most_headers": HEADERS}
    return HttpRefusal(431, "Request Header Fields Too Large", "headers_too_large", text, figures)


def body_too_large(most_bytes: int) -> HttpRefusal:
    """Return the refusal of a body with more than `most_bytes`."""
    text = say("Not done: the request's body is larger than {most} bytes.", most=most_bytes)
    return HttpRefusal(413, "Content Too Large", "body_too_large", text, {"most_bytes": most_bytes})


def too_slow(seconds: float) -> HttpRefusal:
    """Return the refusal of a request that did not arrive in time."""
    text = say("Not done: the request did not arrive within {seconds:g} s.", seconds=seconds)
    return HttpRefusal(408, "Request Timeout", "request_too_slow", text, {"most_s": seconds})


def malformed() -> HttpRefusal:
    """Return the refusal of a request that is not valid HTTP."""
    return HttpRefusal(
        400, "Bad Request", "malformed", say("Not done: this is not a well-formed HTTP request.")
    )


def busy() -> HttpRefusal:
    """Return the refusal because of too many connections or requests at once."""
    text = say("Not done: the server is busy. Try again in a moment.")
    return HttpRefusal(503, "Service Unavailable", "busy", text, retry_after_s=2)


def not_a_proxy() -> HttpRefusal:
    """Return the refusal of a connection past the proxies: nobody could believe its headers."""
    text = say("Not done: the console answers here only to its proxies. Use its public address.")
    return HttpRefusal(403, "Forbidden", "not_a_proxy", text)


def no_answer() -> HttpRefusal:
    """Return the refusal if the pages process has died, or does not start."""
    text = say("The server did not answer this. Look whether it was done, and try again in a moment.")
    return HttpRefusal(503, "Service Unavailable", "no_answer", text, retry_after_s=2)


def most_body_bytes(*, session_cookie: bool) -> int:
    """Return the size of the largest allowed body in bytes."""
    return SIGNED_IN_BODY_BYTES if session_cookie else BODY_BYTES
