"""Check session cookies: an invalid cookie gives an unknown client no advantage."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor

from django.db import DatabaseError, close_old_connections

from robots.processes.scheduling import ask_for_stop_priority

_thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="sessions", initializer=ask_for_stop_priority)


def look_up(key: str) -> asyncio.Future[bool]:
    """Return whether there is such a session.

    True if the database does not answer: Django then shows the error.
    """
    return asyncio.get_running_loop().run_in_executor(_thread, _exists, key)


def _exists(key: str) -> bool:
    from django.contrib.sessions.backends.db import SessionStore  # not above: Django has to be set up first

    close_old_connections()
    try:
        return SessionStore().exists(key)
    except DatabaseError:
        return True
    finally:
        close_old_connections()
