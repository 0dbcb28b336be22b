"""The queue of requests that check or set a password: a few run at once, the others wait on the event loop.

So fifty people who sign in at the same moment all get their answer, and no page waits for them. Networks take turns:
one with many requests delays only itself, and neither one nor all of them fill the console: beyond the bounds a request
is refused (`QueueFull`). People who are signed in have turns of their own, so that strangers never delay them. A page
may ask for its place meanwhile (`PLACE`), by a ticket that it chose.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import parse_qs

from fleet.accounts.sign_in.hashing import PROCESSES
from fleet.base.web.network_addresses import network_of
from fleet.server.turns import Turns

AT_ONCE = PROCESSES + 1  # while one reads and writes the database, every process hashes
OWN_AT_ONCE = 2
# Below `fleet.server.limits.REQUESTS` and `REQUESTS_OF_ADDRESS`: other pages have the rest
MOST_WAITING = 200
MOST_OF_NETWORK = 120
PLACE = "/accounts/sign-in/place/"
QUEUED = ("/accounts/sign-in/", "/accounts/password/", "/accounts/again/", "/welcome/", "/join/", "/setup/")
OWN = ("/accounts/password/", "/accounts/again/")  # answer strangers at once, without a hash


class QueueFull(Exception):
    """Too many requests wait."""


class SignInQueue:
    """Requests with a password that wait, in the order in which they came."""

    def __init__(self) -> None:
        self._strangers, self._own = Turns(AT_ONCE), Turns(OWN_AT_ONCE)
        # Whose turns, network and ticket ("" if the page has none) of each that waits
        self._waiting: OrderedDict[object, tuple[Turns, str, str]] = OrderedDict()

    @asynccontextmanager
    async def turn(self, environ: dict[str, Any]) -> AsyncIterator[None]:
        """Context: wait for the turn of a request with a password; other requests have theirs at once.

        Raises `QueueFull`.
        """
        if not queued(environ):
            yield
            return
        turns = self._own if environ["PATH_INFO"] in OWN else self._strangers
        network = network_of(environ.get("REMOTE_ADDR", ""))
        networks = [other for whose, other, _ in self._waiting.values() if whose is turns]
        if len(networks) >= MOST_WAITING or networks.count(network) >= MOST_OF_NETWORK:
            raise QueueFull
        key = object()
        self._waiting[key] = turns, network, _ticket(environ["QUERY_STRING"])
        try:
            async with turns.turn((network,)):
                del self._waiting[key]
                yield
        finally:
            self._waiting.pop(key, None)

    def place(self, scope: dict[str, Any]) -> bytes | None:
        """Return the answer to the question for a place; None: the request asks for something else."""
        if scope["path"] != PLACE:
            return None
        tickets = [ticket for whose, _, ticket in self._waiting.values() if whose is self._strangers]
        mine = _ticket(scope["query_string"].decode("latin-1"))
        ahead = tickets.index(mine) if mine and mine in tickets else None
        return json.dumps({"ahead": ahead, "waiting": len(tickets)}).encode()


def queued(environ: dict[str, Any]) -> bool:
    """Return whether a request checks or sets a password."""
    path: str = environ["PATH_INFO"]
    return environ["REQUEST_METHOD"] == "POST" and path.startswith(QUEUED)


def _ticket(query: str) -> str:
    """Return the ticket in a request's query; "" if it has none."""
    return parse_qs(query).get("ticket", [""])[0][:64]
