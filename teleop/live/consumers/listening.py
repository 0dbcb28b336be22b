"""WebSockets of pages that only listen, and the one reader that looks for all of them in this web process."""

from __future__ import annotations

import asyncio
import logging
from typing import ClassVar, Generic, TypeVar

from django.db import DatabaseError

from robots.shared import wire
from robots.shared.wire import Refusal, fleet_message
from teleop.background.jobs import run_in_background
from teleop.live.consumers.message_socket import MessageSocket

log = logging.getLogger(__name__)


class ListeningSocket(MessageSocket):
    """A page that asks for nothing: it only sends pings."""

    async def on_message(self, raw: str) -> None:
        match fleet_message(raw):
            case wire.Ping(sent_ms=sent_ms):
                if await self.within_budget("ping"):
                    await self.send_message(wire.Pong(sent_ms))

    def refused_request(self, of: str, refusal: Refusal) -> None:
        """Record nothing: no message asks for anything."""


Page = TypeVar("Page", bound=ListeningSocket)


class SharedReader(Generic[Page]):
    """Looks into the database while a page is open. Subclasses define what they look for and tell `pages`."""

    check_s: ClassVar[float]  # between two looks
    failed: ClassVar[str]  # what pages lack while the database does not answer, for the log

    def __init__(self) -> None:
        self.pages: set[Page] = set()
        self._looking: asyncio.Task[None] | None = None

    def join(self, page: Page) -> None:
        """Add a page."""
        self.pages.add(page)
        if self._looking is None:
            self.begin()
            self._looking = run_in_background(self._keep_looking())

    def leave(self, page: Page) -> None:
        """Remove a page. Nobody looks after the last one."""
        self.pages.discard(page)
        if not self.pages and self._looking is not None:
            self._looking.cancel()
            self._looking = None

    def begin(self) -> None:
        """Prepare for the first look: for some time there was no page."""

    async def look(self) -> None:
        """Look once, and tell the pages. May raise `DatabaseError`."""
        raise NotImplementedError

    async def _keep_looking(self) -> None:
        while True:
            try:
                await self.look()
            except DatabaseError as error:
                log.warning("%s: %s", self.failed, error)
            except Exception:  # a fault must not end the reader: no page would hear anything any more
                log.exception("%s", self.failed)
            await asyncio.sleep(self.check_s)
