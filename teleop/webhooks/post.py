"""One POST to a webhook's address.

Its time and the bytes read of the answer are limited; no redirect is followed.
"""

from __future__ import annotations

import http.client
import socket
import ssl
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import NamedTuple

from django.utils.translation import gettext as _

from robots.shared.wire import NotDone, Refusal
from teleop.webhooks.addresses import Endpoint, Target, resolved

STEP_S = 5.0  # at most to connect, and between two parts of an answer
WHOLE_S = 10.0  # at most in total, because a receiver may send its answer letter by letter
ANSWER_BYTES = 2048
MOST_ENDPOINTS = 2  # addresses of one name: one of each family


class NotSent(NotDone):
    """The receiver did not answer."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(Refusal(code, text, "wire"))


class Answer(NamedTuple):
    """The answer of a receiver: status and the beginning of its text."""

    status: int
    text: str
    location: str  # of a redirect

    @property
    def good(self) -> bool:
        """Return whether the receiver took the event."""
        return 200 <= self.status < 300


def post(target: Target, headers: Mapping[str, str], body: bytes) -> Answer:
    """Send a body, and return the answer. Raises `NotSent` or `AddressRefused`."""
    endpoints = resolved(target)
    try:
        with _connected(target, endpoints) as connection:
            connection.request("POST", target.path, body, {"Host": target.host_header, **headers})
            response = connection.getresponse()
            text = _beginning(response)
            return Answer(response.status, text, response.getheader("Location", ""))
    except (TimeoutError, _TooLong) as error:
        limit_s = WHOLE_S if isinstance(error, _TooLong) else STEP_S
        raise NotSent("timeout", _("No answer within %g s.") % limit_s) from None
    except ssl.SSLCertVerificationError as error:
        raise NotSent("tls", _("The certificate is not valid: %s.") % error.verify_message) from None
    except ssl.SSLError as error:
        raise NotSent("tls", _("TLS failed: %s.") % (error.reason or error)) from None
    except http.client.HTTPException as error:
        raise NotSent("no_http", _("The answer is not HTTP (%s).") % type(error).__name__) from None
    except OSError as error:
        raise NotSent("no_connection", _("No connection: %s.") % (error.strerror or error)) from None


class _TooLong(Exception):
    """The request took longer than `WHOLE_S`."""


@contextmanager
def _connected(target: Target, endpoints: list[Endpoint]) -> Iterator[http.client.HTTPConnection]:
    """Connect to one of these addresses only. Shut the connection down after `WHOLE_S`."""
    sock = _first_that_answers(endpoints)
    line = sock.dup()  # a duplicate, because TLS takes over the original socket
    late = threading.Event()

    def end() -> None:
        late.set()
        with suppress(OSError):
            line.shutdown(socket.SHUT_RDWR)

    watch = threading.Timer(WHOLE_S, end)
    watch.daemon = True
    watch.start()
    try:
        if target.tls:
            sock = ssl.create_default_context().wrap_socket(sock, server_hostname=target.host)
        connection = http.client.HTTPConnection(target.host, target.port)
        connection.auto_open = 0  # opening again would resolve the name again
        connection.sock = sock
        yield connection
    except (OSError, http.client.HTTPException) as error:
        if late.is_set():
            raise _TooLong from error
        raise
    finally:
        watch.cancel()
        line.close()
        sock.close()


def _first_that_answers(endpoints: list[Endpoint]) -> socket.socket:
    families = {endpoint.family: endpoint for endpoint in reversed(endpoints)}  # the first of each
    ordered = [endpoint for endpoint in endpoints if families[endpoint.family] is endpoint][:MOST_ENDPOINTS]
    for number, endpoint in enumerate(ordered, 1):
        sock = socket.socket(endpoint.family, socket.SOCK_STREAM)
        sock.settimeout(STEP_S / len(ordered))
        try:
            sock.connect(endpoint.sockaddr)
        except OSError:
            sock.close()
            if number == len(ordered):
                raise
            continue
        sock.settimeout(STEP_S)
        return sock
    raise NotSent("no_connection", "")


def _beginning(response: http.client.HTTPResponse) -> str:
    """Return the beginning of the answer's text. Errors are ignored: only the status matters."""
    read = b""
    with suppress(OSError, http.client.HTTPException):
        while len(read) < ANSWER_BYTES and (part := response.read1(ANSWER_BYTES - len(read))):
            read += part
    return read.decode(errors="replace")
