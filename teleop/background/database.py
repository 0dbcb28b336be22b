"""Database calls from the event loop, in a few separate threads.

Channels' default is one thread for all consumers: one call that waits for a lock would delay the check of all rights.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import ParamSpec, TypeVar

from channels.db import database_sync_to_async
from django.db import close_old_connections

P = ParamSpec("P")
R = TypeVar("R")

_threads = ThreadPoolExecutor(max_workers=4, thread_name_prefix="database")
# Separate, so that background work never delays the reads of rights in `_threads`.
_background_thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="database-background")


async def in_database(function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
    """Run `function` in a database thread and return its result."""
    call = database_sync_to_async(function, thread_sensitive=False, executor=_threads)
    return await call(*args, **kwargs)


def in_database_background(function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
    """Run `function` in the background thread: no caller waits for it, but the end of the process does."""

    def call() -> R:
        try:
            return function(*args, **kwargs)
        finally:
            close_old_connections()

    return _background_thread.submit(call)
