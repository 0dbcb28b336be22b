"""Handle grants, renewals and revokes in order; a new fence is on disk before it is valid.

A disk may hang. Messages for a fence that is still being written wait for it in order: no revoke overtakes its own
grant. Everything else goes on: the present holder can be stopped or revoked in the meantime.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from robots.bridge.core import Core
from robots.bridge.lease.state_store import Persisted
from robots.bridge.server.link_server import Link
from robots.wire import Grant, Granted, Pause, Refusal, Refused, Revoke

log = logging.getLogger(__name__)

WAITING_MOST = 100  # beyond, the oldest go unanswered; a revoke never goes before its grant

Message = Grant | Revoke | Pause
_Waiting = deque[tuple[Link, Message]]


class StateWriter(Protocol):
    """The state file (`robots.bridge.lease.state_store.StateStore`)."""

    def save(self, state: Persisted) -> None:
        """Write durably, or raise OSError."""


class FenceStore:
    """Control of one robot, as its links give and take it. Runs on the event loop; one thread writes the state file.

    `on_latch` is called when a stop was pressed or cleared, before anybody is told that it was.
    """

    def __init__(
        self, core: Core, store: StateWriter, fence_on_disk: int, on_latch: Callable[[], None] = lambda: None
    ) -> None:
        self._on_latch = on_latch
        self._core = core
        self._store = store
        self._disk = ThreadPoolExecutor(1, thread_name_prefix="state-file")
        self._on_disk = fence_on_disk
        self._writing = False
        self._waiting = _Waiting(maxlen=WAITING_MOST)  # for a number that is not on disk yet

    def hear(self, link: Link, message: Message) -> None:
        """Do what `message` says, now or once its number is on disk."""
        if isinstance(message, Grant):
            refusal = self._core.lease.check(message)
            if refusal is not None:
                link.report(Refused("grant", refusal, fence=message.fence))
                return
            self._core.lease.highest = message.fence
        if message.fence <= self._on_disk or not (self._writing or isinstance(message, Grant)):
            self._do(link, message)
            return
        self._waiting.append((link, message))
        if not self._writing:
            self._write_number()

    def forget(self, link: Link) -> None:
        """A link is gone, and with it what it asked for and did not get yet."""
        self._waiting = _Waiting((entry for entry in self._waiting if entry[0] is not link), WAITING_MOST)

    def save_latch(self) -> Future[None]:
        """Write the stop latch in the background: the robot has been told already. Returns when it is done."""
        self._on_latch()
        saved = self._disk.submit(self._store.save, self._core.persisted())
        saved.add_done_callback(_log_failure)
        return saved

    def close(self) -> None:
        """Wait until everything is written."""
        self._disk.shutdown(wait=True)

    def _do(self, link: Link, message: Message) -> None:
        now_s = time.monotonic()
        match message:
            case Grant():
                self._core.grant(message, link.number, now_s)
                link.report(Granted(message.fence))
            case Revoke():
                self._core.revoke(message.fence, message.reason, now_s)
            case Pause():
                self._core.hold(message.fence, message.reason, link.number, now_s)

    def _write_number(self) -> None:
        self._writing = True
        state = self._core.persisted()
        written = asyncio.wrap_future(self._disk.submit(self._store.save, state))
        written.add_done_callback(lambda future: self._wrote(state.fence, future))

    def _wrote(self, fence: int, written: asyncio.Future[None]) -> None:
        """Go on with what waited; a number that came while this one was written is written next."""
        self._writing = False
        if written.cancelled():  # the bridge ends
            return
        waited, self._waiting = self._waiting, _Waiting(maxlen=WAITING_MOST)
        error = written.exception()
        if error is None:
            self._on_disk = fence
            for link, message in waited:
                self.hear(link, message)
            return
        log.error("a fencing number was not written: %s", error)
        for link, message in waited:
            if isinstance(message, Grant):
                link.report(Refused("grant", _not_saved(error), fence=message.fence))


def _not_saved(error: BaseException) -> Refusal:
    why = error.strerror if isinstance(error, OSError) else error
    text = f"The bridge cannot write its state file ({why}): control is not given."
    return Refusal("state_not_saved", text, "lease")


def _log_failure(saved: Future[None]) -> None:
    error = saved.exception()
    if error is not None:
        log.error("the state file was not written: %s", error)
