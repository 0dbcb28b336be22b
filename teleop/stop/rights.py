"""The right to stop a robot: read for many requests at once, and remembered for a second.

A stop by HTTP is judged here first, on a thread for nothing else, before any other work is done for it. So invented
cookies and tokens, however many, cost one query together, and nobody waits behind them.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple
from uuid import UUID

from django.db import DatabaseError, connection

from fleet.accounts.models import User
from fleet.accounts.selectors import people_of_sessions
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import tokens_by_text
from fleet.base.database import rows
from fleet.base.web.stop_addresses import slug_of
from fleet.server.credentials import Credential
from fleet.server.turns import Key
from robots.access.selectors import visible_to_each
from robots.registry.models import Robot
from robots.shared.processes.scheduling import ask_for_stop_priority

log = logging.getLogger(__name__)

FRESH_S = 1.0  # a right that ends (sign-out, end of a token, role taken away) ends here within this time
MOST_TOGETHER = 200  # credentials of one query
MOST_KNOWN = 5000


class Right(NamedTuple):
    """A person, and the robots that they see and so may stop, by a session or with a token."""

    person: User
    token: Token | None
    robots: tuple[Robot, ...]
    credential: Credential

    @property
    def key(self) -> Key:
        """Return for whom fair queues wait: the person, then the session or token."""
        return self.person.pk, self.credential

    def robots_at(self, path: str) -> list[Robot]:
        """Return the robots that a stop at this path is for: the one that it names, or all in service."""
        slug = slug_of(path)
        if slug is None:
            return [robot for robot in self.robots if robot.enabled]
        return [robot for robot in self.robots if robot.slug == slug]


class Rights:
    """The rights behind credentials. `read` reads them from the database. To be used on one event loop."""

    def __init__(self, read: Callable[[Collection[Credential]], dict[Credential, Right]]) -> None:
        self._read = read
        self._known: OrderedDict[Credential, tuple[Right, float]] = OrderedDict()  # with the time of reading
        self._asked: dict[Credential, asyncio.Future[Right | None]] = {}
        self._reading: asyncio.Task[None] | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="rights", initializer=ask_for_stop_priority)

    def ask(self, credential: Credential) -> asyncio.Future[Right | None]:
        """Return the right behind a credential; None: there is none, or the database does not answer."""
        loop = asyncio.get_running_loop()
        right, read_s = self._known.get(credential, (None, 0.0))
        if right is not None and loop.time() - read_s < FRESH_S:
            fresh: asyncio.Future[Right | None] = loop.create_future()
            fresh.set_result(right)
            return fresh
        asked = self._asked.get(credential)
        if asked is None:
            asked = self._asked[credential] = loop.create_future()
            if self._reading is None:
                self._reading = loop.create_task(self._read_all())
        return asyncio.shield(asked)  # others wait for it, too, if this request is cancelled

    def person_behind(self, credential: Credential) -> UUID | None:
        """Return the person who has stopped a robot, or could have, with this credential before. Reads nothing."""
        right, _ = self._known.get(credential, (None, 0.0))
        return right.person.pk if right is not None and right.robots else None

    async def _read_all(self) -> None:
        """Read until nothing is asked any more; people who are known first."""
        while self._asked:
            order = sorted(self._asked, key=lambda one: one not in self._known)[:MOST_TOGETHER]
            asked = {credential: self._asked.pop(credential) for credential in order}
            began_s = time.monotonic()
            try:
                found = await asyncio.get_running_loop().run_in_executor(
                    self._thread, _with_database, self._read, list(asked)
                )
            except Exception:
                log.exception("It could not be read who may stop robots.")
                found = {}
            for credential, answer in asked.items():
                self._keep(credential, found.get(credential), began_s)
                answer.set_result(found.get(credential))
        self._reading = None

    def _keep(self, credential: Credential, right: Right | None, read_s: float) -> None:
        self._known.pop(credential, None)
        if right is not None:
            self._known[credential] = right, read_s
            if len(self._known) > MOST_KNOWN:
                self._known.popitem(last=False)


def _with_database(
    read: Callable[[Collection[Credential]], dict[Credential, Right]], asked: Collection[Credential]
) -> dict[Credential, Right]:
    """Read, with a connection that stays open. If it is broken, try once more with another one."""
    try:
        return read(asked)
    except DatabaseError:
        connection.close()
        return read(asked)


def read_rights(asked: Collection[Credential]) -> dict[Credential, Right]:
    """Return the rights of those credentials that are valid. Five queries at most, however many are asked."""
    tokens = tokens_by_text([one.text for one in asked if one.is_token])
    people = people_of_sessions([one.text for one in asked if not one.is_token])
    users = {user.pk: user for user in [*people.values(), *(token.user for token in tokens.values())]}
    if not users:
        return {}
    seen = visible_to_each(users.values())
    robots = rows.models(Robot, "SELECT * FROM robots_robot", [])
    rights = {}
    for credential in asked:
        token = tokens.get(credential.text) if credential.is_token else None
        person = token.user if token else None if credential.is_token else people.get(credential.text)
        if person is not None:
            keys = seen[person.pk]
            may_stop = [
                robot
                for robot in robots
                if (keys is None or robot.pk in keys) and (token is None or token.serves(robot.pk))
            ]
            rights[credential] = Right(person, token, tuple(may_stop), credential)
    return rights


rights = Rights(read_rights)
