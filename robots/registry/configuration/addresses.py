"""Checks the addresses of robots and bridges, without using the network."""

from __future__ import annotations

import ipaddress
import re
from urllib.parse import urlsplit

from robots.registry.configuration.profile_schema import Problems

_HOST = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9_-]{1,63}(?<!-))*\.?")


def check_master_uri(uri: str) -> None:
    """Accept http://host:port; else raise `Problems`."""
    _check_url(uri, "http", "http://tiago-42c:11311")


def check_bridge_address(address: str) -> None:
    """Accept an empty text or wss://host:port; else raise `Problems`."""
    if address:
        _check_url(address, "wss", "wss://bridges.lab:7443")


def check_advertised_address(address: str) -> None:
    """Accept an empty text, an IP address or a host name; else raise `Problems`."""
    if address and not _is_host(address):
        raise Problems([_not_a_host(address)])


def check_aliases(aliases: object) -> None:
    """Accept an object of host names, as the robot uses them, and their IP addresses; else raise `Problems`."""
    if not isinstance(aliases, dict):
        raise Problems(['Write an object of names and addresses, such as {"tiago-42c": "10.68.0.1"}.'])
    names = [f"{name!r} is not a host name (such as tiago-42c)." for name in aliases if not _is_name(name)]
    addresses = [
        f"{name}: {address!r} is not an IP address (such as 10.68.0.1)."
        for name, address in aliases.items()
        if not isinstance(address, str) or not is_address(address)
    ]
    if names or addresses:
        raise Problems(names + addresses)


def is_address(host: str) -> bool:
    """Return whether `host` is an IP address. An address with an IPv6 zone is refused: a zone may be any text."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return "%" not in host


def _is_host(host: str) -> bool:
    """Return whether `host` is an IP address or could be a host name."""
    return is_address(host) or _is_name(host)


def _is_name(host: str) -> bool:
    only_digits_and_dots = re.fullmatch(r"[0-9.]+", host)  # a mistyped address
    return bool(_HOST.fullmatch(host)) and not only_digits_and_dots


def _not_a_host(host: str) -> str:
    return f"{host!r} is neither an IP address (such as 10.68.0.2) nor a host name (such as console.lab)."


def _check_url(url: str, scheme: str, example: str) -> None:
    problem = _url_problem(url, scheme)
    if problem:
        raise Problems([f"{problem} Write it as {scheme}://host:port, such as {example}."])


def _url_problem(url: str, scheme: str) -> str | None:
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return f"{url!r} has no valid port (1 to 65535)."
    if parts.scheme != scheme:
        return f"{url!r} does not begin with {scheme}://."
    if not parts.hostname or "@" in parts.netloc:
        return f"{url!r} names no host."
    if not _is_host(parts.hostname):
        return _not_a_host(parts.hostname)
    if not port:
        return f"{url!r} names no port."
    if parts.path not in ("", "/") or parts.query or parts.fragment:
        return f"{url!r} has something after the port."
    return None
