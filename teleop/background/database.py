"""The way from the event loop to the database: a few threads of their own.

Channels' default is one thread for all consumers: one that waits for a lock would keep everybody's rights from
being checked.
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
_beside = ThreadPoolExecutor(max_workers=1, thread_name_prefix="beside")  # rights are confirmed in the others


async def in_database(function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
    """Run `function` in a thread that may use the database."""
    call = database_sync_to_async(function, thread_sensitive=False, executor=_threads)
    return await call(*args, **kwargs)


def in_database_background(function: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
    """In a thread of its own, for what nobody waits for: only the end of the process does."""

    def call() -> R:
        try:
            return function(*args, **kwargs)
        finally:
            close_old_connections()

    return _beside.submit(call)
