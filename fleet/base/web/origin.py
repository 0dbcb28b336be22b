"""The console's address as links in e-mails, calendar feeds and invitations name it.

A Host header comes from anybody, so it only chooses among the names of `FLEET_HOSTS` that other computers can use: the
one in use, which this reader can reach, else the first. The port is that of the socket at which the request came.
`FLEET_ORIGINS` says it where a proxy has another port.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from ipaddress import ip_address

from django.conf import settings
from django.http import HttpRequest
from django.http.request import split_domain_port

PORT_HEADER = "X-Fleet-Port"  # from the web process to its pages process, which listens on a Unix socket
_USUAL = {"http": "80", "https": "443"}
_request: ContextVar[HttpRequest | None] = ContextVar("request", default=None)


def public_origin(request: HttpRequest) -> str:
    """Return scheme, host and port, such as `https://fleet.lab.example` or `http://192.168.1.20:8000`."""
    if origin := _of_settings():
        return origin
    scheme = "https" if settings.FLEET_TLS else "http"
    port = _port(request)
    suffix = f":{port}" if port and port != _USUAL[scheme] else ""
    return f"{scheme}://{_host(request)}{suffix}"


@contextmanager
def during(request: HttpRequest) -> Iterator[None]:
    """Let `usual_origin` return the origin of this request while it runs."""
    token = _request.set(request)
    try:
        yield
    finally:
        _request.reset(token)


def usual_origin() -> str:
    """Return the origin of the running request; without one, `settled_origin`."""
    return public_origin(request) if (request := _request.get()) is not None else settled_origin()


def settled_origin() -> str:
    """Return the origin by the settings alone, as letters without a request name it; blank if they do not tell it.

    Plain http has a port, which only a request knows.
    """
    if (origin := _of_settings()) or not settings.FLEET_TLS:
        return origin
    reachable = [host for host in _hosts() if not _is_loopback(host)]
    return f"https://{reachable[0]}" if reachable else ""


def public_url(request: HttpRequest, path: str) -> str:
    """Return the whole address of a path of the console."""
    return f"{public_origin(request)}{path}"


def _of_settings() -> str:
    origins = (str(one) for one in settings.FLEET_ORIGINS)
    return next((one for one in origins if one.startswith("https:") or not settings.FLEET_TLS), "")


def _hosts() -> list[str]:
    return [host for host in settings.ALLOWED_HOSTS if not host.startswith((".", "*"))]


def _host(request: HttpRequest) -> str:
    reachable = [host for host in _hosts() if not _is_loopback(host)]
    in_use = split_domain_port(request.get_host())[0]
    # With this computer's own names only, nobody else follows a link: then the name in use, one of `FLEET_HOSTS`.
    return in_use if in_use in reachable or not reachable else reachable[0]


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")


def _port(request: HttpRequest) -> str:
    """Return the port of the socket at which browsers knock; blank: that of a proxy, which is the usual one."""
    if "FLEET_PROGRAMS_SOCKET" in os.environ:  # this is the pages process
        return request.headers.get(PORT_HEADER, "")
    return "" if settings.FLEET_TLS else str(request.META["SERVER_PORT"])
