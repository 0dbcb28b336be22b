"""Allowed addresses of webhooks: no private network or this computer, unless in `FLEET_WEBHOOK_ALLOW`.

A name is resolved once for each request, and the request goes to an address that was checked here: a second
resolution could return another address.
"""

from __future__ import annotations

import re
import socket
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from typing import Any, NamedTuple
from urllib.parse import SplitResult, urlsplit

from django.conf import settings
from django.utils.translation import gettext as _

from fleet.base.environment import WebhookAllow
from robots.shared.wire import NotDone, Refusal

LONGEST = 500  # characters
UNKNOWN_HOST = "no_such_host"  # also while the name server cannot be reached
_PRINTED = re.compile(r"[\x21-\x7e]+")
_NAT64 = ip_network("64:ff9b::/96")
# These networks are not global either, but not every Python version that we support knows this.
_RESERVED: tuple[IPv4Network | IPv6Network, ...] = tuple(
    ip_network(network)
    for network in (
        "192.0.0.0/24",
        "192.88.99.0/24",
        "64:ff9b:1::/48",
        "100::/64",
        "2001:db8::/32",
        "5f00::/16",
    )
)


class AddressRefused(NotDone):
    """A webhook may not have this address."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(Refusal(code, text, "wire"))


class Target(NamedTuple):
    """The parts of a webhook's address."""

    tls: bool
    host: str
    port: int
    path: str  # with the query
    host_header: str
    allow: WebhookAllow


class Endpoint(NamedTuple):
    """An IP address and port of a name: the arguments of `socket.socket` and of `connect`."""

    family: socket.AddressFamily
    sockaddr: tuple[Any, ...]


def target_of(address: str, allow: WebhookAllow | None = None) -> Target:
    """Split an address into its parts. The name is not resolved.

    Raises `AddressRefused` for an address that no webhook may have. `allow`: another list than that of webhooks.
    """
    allow = settings.FLEET_WEBHOOK_ALLOW if allow is None else allow
    if not _PRINTED.fullmatch(address) or len(address) > LONGEST:
        raise AddressRefused(
            "bad_address",
            _("Write the address in at most %d letters, digits and signs without blanks.") % LONGEST,
        )
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError:
        raise AddressRefused("bad_address", _("The address cannot be read.")) from None
    if parts.scheme not in ("http", "https") or not parts.hostname or port == 0:
        raise AddressRefused("bad_address", _("An address looks like https://ci.example.org/fleet."))
    if parts.username is not None or parts.fragment:
        raise AddressRefused("bad_address", _("Leave out the name, the password and the part after #."))
    host = parts.hostname
    if parts.scheme == "http" and not (host in allow.hosts or allow.networks):
        raise AddressRefused("no_tls", _("Use https. Plain http is only for hosts in FLEET_WEBHOOK_ALLOW."))
    literal = _literal(host)
    if literal is not None:
        _require_allowed(host, literal, allow, tls=parts.scheme == "https")
    return Target(
        tls=parts.scheme == "https",
        host=host,
        port=port or (443 if parts.scheme == "https" else 80),
        path=_path_of(parts),
        host_header=parts.netloc,
        allow=allow,
    )


def resolved(target: Target) -> list[Endpoint]:
    """Return the addresses of the target's host to which the request may go.

    Raises `AddressRefused` if there is none.
    """
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise AddressRefused(
            UNKNOWN_HOST, _("The name %(host)s has no address.") % {"host": target.host}
        ) from None
    endpoints, refused = [], AddressRefused(UNKNOWN_HOST, "")
    for family, _type, _protocol, _name, sockaddr in found:
        try:
            _require_allowed(target.host, ip_address(sockaddr[0]), target.allow, tls=target.tls)
            endpoints.append(Endpoint(family, sockaddr))
        except AddressRefused as refusal:
            refused = refusal
    if not endpoints:
        raise refused
    return endpoints


def is_public(address: IPv4Address | IPv6Address) -> bool:
    """Return whether an address belongs to the internet. If it contains an IPv4 address, that one decides."""
    if isinstance(address, IPv6Address):
        wrapped = address.ipv4_mapped or address.sixtofour
        if wrapped is None and address in _NAT64:
            wrapped = IPv4Address(int(address) & 0xFFFF_FFFF)
        if wrapped is not None:
            return is_public(wrapped)
        if address.teredo is not None or address.is_site_local:
            return False
    return address.is_global and not (
        address.is_private
        or address.is_loopback
        or address.is_link_local
        or address.is_multicast
        or address.is_reserved
        or address.is_unspecified
        or any(address in network for network in _RESERVED)
    )


def _require_allowed(
    host: str, address: IPv4Address | IPv6Address, allow: WebhookAllow, *, tls: bool
) -> None:
    plain = address.ipv4_mapped or address if isinstance(address, IPv6Address) else address
    if host in allow.hosts or any(plain in network for network in allow.networks):
        return
    if not is_public(address):
        raise AddressRefused(
            "private_address",
            _(
                "%(host)s is at %(address)s, in a private or reserved network. "
                "FLEET_WEBHOOK_ALLOW does not have it."
            )
            % {"host": host, "address": address},
        )
    if not tls:
        raise AddressRefused("no_tls", _("Use https. Plain http is only for hosts in FLEET_WEBHOOK_ALLOW."))


def _literal(host: str) -> IPv4Address | IPv6Address | None:
    try:
        return ip_address(host)
    except ValueError:
        return None


def _path_of(parts: SplitResult) -> str:
    return (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
