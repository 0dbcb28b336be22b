"""The queue of requests that check or set a password: a few run at once, the others wait on the event loop.

So fifty people who sign in at the same moment all get their answer, and no page waits for them. Networks take turns:
one with many requests delays only itself. A page may ask for its place meanwhile (`PLACE`), by a ticket that it chose.
"""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import parse_qs

from fleet.accounts.sign_in.hashing import PROCESSES
from fleet.base.network_addresses import network_of
from fleet.server.turns import Turns

AT_ONCE = PROCESSES + 1  # while one reads and writes the database, every process hashes
PLACE = "/accounts/sign-in/place/"
QUEUED = ("/accounts/sign-in/", "/accounts/password/", "/accounts/again/", "/welcome/", "/join/", "/setup/")


class SignInQueue:
    """Sign-ins that wait, in the order in which they came."""

    def __init__(self) -> None:
        self._turns = Turns(AT_ONCE)
        self._waiting: OrderedDict[object, str] = OrderedDict()  # tickets; "" if the page has none

    @asynccontextmanager
    async def turn(self, environ: dict[str, Any]) -> AsyncIterator[None]:
        """Context: wait for the turn of a request with a password; other requests have theirs at once."""
        if not queued(environ):
            yield
            return
        key = object()
        self._waiting[key] = _ticket(environ["QUERY_STRING"])
        network = network_of(environ.get("REMOTE_ADDR", ""))
        try:
            async with self._turns.turn((network,)):
                del self._waiting[key]
                yield
        finally:
            self._waiting.pop(key, None)

    def place(self, scope: dict[str, Any]) -> bytes | None:
        """Return the answer to the question for a place; None: the request asks for something else."""
        if scope["path"] != PLACE:
            return None
        tickets = list(self._waiting.values())
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
