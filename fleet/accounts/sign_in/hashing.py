"""One thread of low priority hashes passwords, and few may wait for it: sign-ins never delay driving.

One bcrypt takes a quarter of a second of a core. It releases Python's lock, so several at once would take the cores
from the event loop and from the bridges.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from django.contrib.auth.hashers import BCryptSHA256PasswordHasher

R = TypeVar("R")

MOST_WAITING = 20  # about five seconds of work; a class signs in within half a minute
NICENESS = 19  # below the pages, too
RETRY_AFTER_S = 5


class HashingBusy(Exception):
    """The queue is full: the password was not looked at."""

    code = "sign_in_busy"
    text = "Not done: many people sign in at this moment. Try again in a moment."
    rule = "limits"


def _give_way() -> None:
    """On Linux a priority belongs to a thread."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


_thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hashing", initializer=_give_way)
_places = threading.BoundedSemaphore(MOST_WAITING)


def hashed(function: Callable[[], R]) -> R:
    """Run `function`, which hashes, in the thread for it, and wait. Raises `HashingBusy` if too many wait."""
    if not _places.acquire(blocking=False):
        raise HashingBusy(HashingBusy.text)
    try:
        return _thread.submit(function).result()
    finally:
        _places.release()


class QueuedBCrypt(BCryptSHA256PasswordHasher):
    """Django's bcrypt, by the thread for it. Known and unknown names take the same way."""

    def encode(self, password: str, salt: Any) -> str:
        """A hash, new or to compare with. Raises `HashingBusy` if too many wait."""
        return hashed(lambda: super(QueuedBCrypt, self).encode(password, salt))
