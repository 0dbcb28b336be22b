"""Resolves robots' host names on a separate thread, because a silent name server blocks for long."""

from __future__ import annotations

import socket
from collections.abc import Set

from robots.bridge.robot.worker import Worker


class HostNames:
    """The host names that a robot's nodes advertise."""

    def __init__(self) -> None:
        self._worker = Worker("names")
        self._wanted: Set[str] = frozenset()
        self._unknown: Set[str] = frozenset()

    def unknown(self, hosts: Set[str]) -> Set[str]:
        """Return the names that failed to resolve at the last try. Starts a new try of all, and returns at once."""
        self._wanted = hosts
        self._worker.do(self._look_up)
        return hosts & self._unknown

    def _look_up(self) -> None:
        self._unknown = {host for host in self._wanted if not _is_known(host)}


def _is_known(host: str) -> bool:
    try:
        socket.getaddrinfo(host, None)
    except (OSError, ValueError):  # ValueError: not a host name
        return False
    return True
