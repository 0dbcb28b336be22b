"""One thread of low priority hashes passwords, with a short queue: sign-ins never delay driving.

One bcrypt hash takes a quarter of a second of a core. It releases Python's lock (GIL), so several hashes at
once would take the cores away from the event loop and from the bridges.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, TypeVar

from django.contrib.auth.hashers import BCryptSHA256PasswordHasher

from robots.shared.sentences import say

R = TypeVar("R")

MOST_WAITING = 20  # about five seconds of work; a class of students signs in within half a minute
NICENESS = 19  # lower priority than the pages, too
RETRY_AFTER_S = 5


class HashingBusy(Exception):
    """The queue is full: the password was not checked."""

    code = "sign_in_busy"
    text = say("Not done: many people sign in at this moment. Try again in a moment.")
    rule: Final = "limits"


def _give_way() -> None:
    """Lower the priority of this thread. On Linux each thread has its own priority."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


_thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hashing", initializer=_give_way)
_places = threading.BoundedSemaphore(MOST_WAITING)


def hashed(function: Callable[[], R]) -> R:
    """Run `function` in the hashing thread and return its result. Raises `HashingBusy` if too many wait."""
    if not _places.acquire(blocking=False):
        raise HashingBusy(HashingBusy.text)
    try:
        return _thread.submit(function).result()
    finally:
        _places.release()


class QueuedBCrypt(BCryptSHA256PasswordHasher):
    """Django's bcrypt, run in the hashing thread, for known and unknown user names alike."""

    def encode(self, password: str, salt: Any) -> str:
        """Return the hash of a password, to store or to compare. Raises `HashingBusy` if too many wait."""
        return hashed(lambda: super(QueuedBCrypt, self).encode(password, salt))
