"""Limits of a request before any view has looked at it.

The server does not know yet who asks: a session cookie is a hint and no proof. Requests with one may bring a larger
body, because admin forms do; all bodies together are bounded as well.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

URL_BYTES = 4096
HEAD_BYTES = 16384  # request line and headers
HEADERS = 100
BODY_BYTES = 64 * 1024  # of a stranger: a sign-in form has less than one
SIGNED_IN_BODY_BYTES = 4 * 1024 * 1024  # an admin form: Django itself takes 2.5 MB
BODIES_BYTES = 64 * 1024 * 1024  # all bodies that arrive at this moment

UNHEARD_BYTES = 64 * 1024  # of one connection, that wait for their turn: no more is read meanwhile

HEAD_S = 10.0  # from the first byte of a request, or from connecting, to the end of its headers
BODY_S = 60.0  # from the end of the headers to the end of the body
IDLE_S = 60.0  # between two requests
UNREAD_S = 60.0  # so long a client may leave unread what was sent of an answer

# A class of 60 sits behind one address; a browser opens six connections and some WebSockets for each page.
CONNECTIONS = 2000
CONNECTIONS_OF_ADDRESS = 1000
WEBSOCKETS_OF_ADDRESS = 600
REQUESTS = 400  # that wait for their answers
REQUESTS_OF_ADDRESS = 200

MESSAGE_BYTES = (
    64 * 1024
)  # of a WebSocket: pages send 8 KiB at most, and larger messages are refused in words
HANDSHAKE_BYTES = 16384  # that a WebSocket may send before it was accepted
MESSAGES_WAITING = 1000  # of one WebSocket, not yet heard by the console


@dataclass(frozen=True)
class Refusal:
    """A request that is not let in: HTTP status, and the refusal as every interface of the console says it.

    The answer is a problem document (RFC 9457), as the API promises.
    """

    status: int
    reason: str
    code: str
    text: str
    figures: tuple[tuple[str, float], ...] = ()
    retry_after_s: int | None = None

    def response(self) -> bytes:
        """The whole HTTP response; the connection closes after it."""
        refusal = {"code": self.code, "text": self.text, "rule": "limits", "figures": dict(self.figures)}
        problem = {"type": "about:blank", "title": self.reason, "status": self.status, "detail": self.text}
        body = json.dumps({**problem, **refusal, "refusals": [refusal]}).encode()
        retry = f"Retry-After: {self.retry_after_s}\r\n" if self.retry_after_s else ""
        head = (
            f"HTTP/1.1 {self.status} {self.reason}\r\nContent-Type: application/problem+json\r\n"
            f"Content-Length: {len(body)}\r\n{retry}Cache-Control: no-store\r\nConnection: close\r\n\r\n"
        )
        return head.encode() + body


class Refused(Exception):
    """A request passed a limit while it arrived."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


def url_too_long() -> Refusal:
    """More than `URL_BYTES` in the request line."""
    text = f"Not done: the address is longer than {URL_BYTES} bytes."
    return Refusal(414, "URI Too Long", "url_too_long", text, (("most_bytes", URL_BYTES),))


def head_too_large() -> Refusal:
    """More than `HEADERS` headers, or `HEAD_BYTES` of them."""
    text = f"Not done: the request has more than {HEADERS} headers or {HEAD_BYTES} bytes of them."
    figures = (("most_bytes", HEAD_BYTES), ("most_headers", HEADERS))
    return Refusal(431, "Request Header Fields Too Large", "headers_too_large", text, figures)


def body_too_large(most_bytes: int) -> Refusal:
    """More than `most_bytes` in the body."""
    text = f"Not done: the request's body is larger than {most_bytes} bytes."
    return Refusal(413, "Content Too Large", "body_too_large", text, (("most_bytes", most_bytes),))


def too_slow(seconds: float) -> Refusal:
    """The request did not arrive in time."""
    text = f"Not done: the request did not arrive within {seconds:g} s."
    return Refusal(408, "Request Timeout", "request_too_slow", text, (("most_s", seconds),))


def malformed() -> Refusal:
    """This is no HTTP."""
    return Refusal(400, "Bad Request", "malformed", "Not done: this is not a well-formed HTTP request.")


def busy() -> Refusal:
    """Too many connections or requests at once."""
    text = "Not done: the console is busy. Try again in a moment."
    return Refusal(503, "Service Unavailable", "busy", text, retry_after_s=2)


def no_answer() -> Refusal:
    """The pages process died meanwhile, or does not start."""
    text = "The console did not answer this. Look whether it was done, and try again in a moment."
    return Refusal(503, "Service Unavailable", "no_answer", text, retry_after_s=2)


def most_body_bytes(*, session_cookie: bool) -> int:
    """Return the largest allowed body, bytes."""
    return SIGNED_IN_BODY_BYTES if session_cookie else BODY_BYTES
