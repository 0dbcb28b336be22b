"""Take grants, revokes and pauses in order; store each new fence on disk before it is in force.

A disk may hang. Messages about a fence that is still being written wait, in order: a revoke never overtakes
its grant. Other messages are applied at once, for example the pause or revoke of an older holder.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from robots.bridge.core import Core
from robots.bridge.lease.state_store import StateStore
from robots.bridge.server.link_server import Link
from robots.shared.sentences import say
from robots.shared.wire import Grant, Granted, Pause, Refusal, Refused, Revoke

log = logging.getLogger(__name__)

MAX_WAITING = 100  # if more messages wait, the oldest are dropped: never a revoke before its grant

Message = Grant | Revoke | Pause
_Waiting = deque[tuple[Link, Message]]


class LeaseOrders:
    """Apply grants, revokes and pauses of one robot in order. Runs on the event loop; one thread writes the state file.

    `on_change` is called when control changes, and when stop is pressed or cleared, before anybody is notified.
    """

    def __init__(
        self, core: Core, store: StateStore, fence_on_disk: int, on_change: Callable[[], None] = lambda: None
    ) -> None:
        self._on_change = on_change
        self._core = core
        self._store = store
        self._disk = ThreadPoolExecutor(1, thread_name_prefix="state-file")
        self._on_disk = fence_on_disk
        self._writing = False
        self._waiting = _Waiting(maxlen=MAX_WAITING)  # messages about a fence that is not on disk yet

    def handle(self, link: Link, message: Message) -> None:
        """Apply `message` now, or when its fence is on disk."""
        if isinstance(message, Grant):
            refusal = self._core.lease.refuse_grant(message)
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
        """Drop the waiting messages of a closed link."""
        self._waiting = _Waiting((entry for entry in self._waiting if entry[0] is not link), MAX_WAITING)

    def save_latch(self) -> Future[None]:
        """Write the state in the background. A stop does not wait for this: the robot brakes already.

        The returned future is done when the state is written.
        """
        self._on_change()
        saved = self._disk.submit(self._store.save, self._core.saved_state())
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
                self._on_change()
                link.report(Granted(message.fence))
            case Revoke():
                self._core.revoke(message.fence, message.sentence_of("reason"), now_s)
                self._on_change()
            case Pause():
                self._core.pause(message.fence, message.sentence_of("reason"), link.number, now_s)

    def _write_number(self) -> None:
        self._writing = True
        state = self._core.saved_state()
        written = asyncio.wrap_future(self._disk.submit(self._store.save, state))
        written.add_done_callback(lambda future: self._wrote(state.fence, future))

    def _wrote(self, fence: int, written: asyncio.Future[None]) -> None:
        """Apply the waiting messages. A fence that arrived during this write is written next."""
        self._writing = False
        if written.cancelled():  # the bridge ends
            return
        waited, self._waiting = self._waiting, _Waiting(maxlen=MAX_WAITING)
        error = written.exception()
        if error is None:
            self._on_disk = fence
            for link, message in waited:
                self.handle(link, message)
            return
        log.error("writing a fence failed: %s", error)
        for link, message in waited:
            if isinstance(message, Grant):
                link.report(Refused("grant", _not_saved(error), fence=message.fence))


def _not_saved(error: BaseException) -> Refusal:
    why = error.strerror if isinstance(error, OSError) else error
    text = say("The bridge cannot write its state file ({why}), so it grants no control.", why=why)
    return Refusal("state_not_saved", text, "lease")


def _log_failure(saved: Future[None]) -> None:
    error = saved.exception()
    if error is not None:
        log.error("writing the state file failed: %s", error)
