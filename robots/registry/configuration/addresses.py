"""Checks the addresses of robots and bridges, without using the network."""

from __future__ import annotations

import ipaddress
import re
from urllib.parse import urlsplit

from robots.registry.configuration.profile_schema import Problems
from robots.shared.configuration.denylist import FULL_NAME
from robots.shared.sentences import Sentence, joined, say

_NO_IPV6 = say("ROS 1 nodes reach each other by IPv4: write the robot’s IPv4 address or its name.")
_THIS_NETWORK = ipaddress.ip_network(
    "0.0.0.0/8"
)  # a program that listens writes 0.0.0.0; nothing can be sent there
_HOST = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9_-]{1,63}(?<!-))*\.?")


def check_master_uri(uri: str) -> None:
    """Accept http://host:port, without IPv6; else raise `Problems`."""
    if not uri:
        raise Problems(
            [
                say(
                    "Write the address of the robot’s ROS master, such as {example}.",
                    example="http://tiago-42c:11311",
                )
            ]
        )
    _check_url(uri, "http", "http://tiago-42c:11311")


def check_peers(peers: str) -> None:
    """Accept IP addresses and host names with spaces between them; else raise `Problems`."""
    problems = [
        _nobodys(peer) if _is_host(peer) else _not_a_host(peer) for peer in peers.split() if _is_no_peer(peer)
    ]
    if problems:
        raise Problems(problems)


def _is_no_peer(peer: str) -> bool:
    return not _is_host(peer) or _is_nobodys(peer)


def check_discovery_server(address: str) -> None:
    """Accept an empty text or host:port; else raise `Problems`."""
    if not address:
        return
    host, _, port = address.rpartition(":")
    if (
        _is_no_peer(host)
        or _is_ipv6(host)
        or not (port.isascii() and port.isdigit() and 0 < int(port) < 65536)
    ):
        words = "{address} is not host:port, such as 10.68.0.1:11811."
        raise Problems([say(words, address=repr(address))])


def check_namespace(namespace: str) -> None:
    """Accept an empty text or a full ROS name; else raise `Problems`."""
    if namespace and not FULL_NAME.fullmatch(namespace):
        words = "{name} is not a namespace such as /tiago1 (leading slash, letters, digits, _)."
        raise Problems([say(words, name=repr(namespace))])


def check_setup(path: str) -> None:
    """Accept an empty text or a full path; else raise `Problems`. The script is on the bridge's computer."""
    if path and not re.fullmatch(r"/[^\x00-\x1f]+", path):
        words = "{path} is not a full path such as /opt/ros/jazzy/setup.bash."
        raise Problems([say(words, path=repr(path))])


def check_bridge_address(address: str) -> None:
    """Accept an empty text or wss://host:port; else raise `Problems`."""
    if address:
        _check_url(address, "wss", "wss://bridges.lab:7443")


def check_advertised_address(address: str) -> None:
    """Accept an empty text, an IPv4 address or a host name; else raise `Problems`."""
    if address and not _is_host(address):
        raise Problems([_not_a_host(address)])
    if _is_nobodys(address):
        raise Problems([_nobodys(address)])
    if _is_ipv6(address):
        raise Problems([_ipv6(address)])


def check_aliases(aliases: object) -> None:
    """Accept an object of host names, as the robot uses them, and their IPv4 addresses; else raise `Problems`."""
    if not isinstance(aliases, dict):
        raise Problems(
            [
                say(
                    "Write an object of names and addresses, such as {example}.",
                    example='{"tiago-42c": "10.68.0.1"}',
                )
            ]
        )
    names = [
        say("{name} is not a host name (such as tiago-42c).", name=repr(name))
        for name in aliases
        if not _is_name(name)
    ]
    addresses = [
        say("{name}: {address} is not an IP address (such as 10.68.0.1).", name=name, address=repr(address))
        for name, address in aliases.items()
        if not isinstance(address, str) or not is_address(address)
    ]
    addresses += [
        say("{name}: {why}", name=name, why=_ipv6(address))
        for name, address in aliases.items()
        if isinstance(address, str) and is_address(address) and _is_ipv6(address)
    ]
    addresses += [
        say("{name}: {why}", name=name, why=_nobodys(address))
        for name, address in aliases.items()
        if isinstance(address, str) and _is_nobodys(address)
    ]
    if names or addresses:
        raise Problems(names + addresses)


def _is_nobodys(host: str) -> bool:
    """Return whether `host` is an IP address that no computer has: of no computer yet, of several, of all."""
    if not is_address(host):
        return False
    address = ipaddress.ip_address(host)
    address = getattr(address, "ipv4_mapped", None) or address
    if address.is_unspecified or address.is_multicast:
        return True
    return address.version == 4 and (address.is_reserved or address in _THIS_NETWORK)


def _nobodys(host: str) -> Sentence:
    return say(
        "{host} is the address of no computer: write the computer’s own address or its name.", host=repr(host)
    )


def _ipv6(host: str) -> Sentence:
    return say("{host} is an IPv6 address. {advice}", host=repr(host), advice=_NO_IPV6)


def _is_ipv6(host: str) -> bool:
    return ":" in host


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


def _not_a_host(host: str) -> Sentence:
    return say(
        "{host} is neither an IP address (such as 10.68.0.2) nor a host name (such as console.lab).",
        host=repr(host),
    )


def _check_url(url: str, scheme: str, example: str) -> None:
    problem = _url_problem(url, scheme)
    if problem:
        advice = say("Write it as {scheme}://host:port, such as {example}.", scheme=scheme, example=example)
        raise Problems([joined(" ", [problem, advice])])


def _url_problem(url: str, scheme: str) -> Sentence | None:
    if re.search(r"[\x00-\x20\s]", url):  # Python leaves some of these out
        return say("{url} has spaces or control characters in it.", url=repr(url))
    try:
        parts = urlsplit(url)
    except ValueError:
        return say("{url} has brackets that do not fit.", url=repr(url))
    try:
        port = parts.port
    except ValueError:
        port = 0
    if parts.scheme != scheme:
        return say("{url} does not begin with {scheme}://.", url=repr(url), scheme=scheme)
    if "@" in parts.netloc:
        return say("{url} has a user or password, which is not sent.", url=repr(url))
    if not parts.hostname:
        return say("{url} names no host.", url=repr(url))
    if _is_nobodys(parts.hostname):
        return _nobodys(parts.hostname)
    if scheme == "http" and _is_ipv6(parts.hostname):
        return say("{url} has an IPv6 address. {advice}", url=repr(url), advice=_NO_IPV6)
    if not _is_host(parts.hostname):
        return _not_a_host(parts.hostname)
    if port is None:
        return say("{url} names no port.", url=repr(url))
    if port == 0:
        return say("{url} has no valid port (1 to 65535).", url=repr(url))
    if parts.path not in ("", "/") or "?" in url or "#" in url:
        return say("{url} has something after the port.", url=repr(url))
    return None
