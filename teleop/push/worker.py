"""The threads of pushes in a housekeeping process.

One person's devices have one thread at a time: a push service that hangs delays only the pushes of who chose it.
"""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from uuid import UUID

from django.db import DatabaseError, connection
from django.utils import timezone

from fleet.audit.errors import AuditUnavailable
from teleop.push.delivery import people_due, send_due
from teleop.push.keys import public_key

log = logging.getLogger(__name__)

AT_ONCE = 8


class PushWorker:
    """Sends what is queued. Its process calls `step` every second."""

    def __init__(self) -> None:
        self._sending = ThreadPoolExecutor(max_workers=AT_ONCE, thread_name_prefix="push")
        self._busy: dict[UUID, Future[None]] = {}
        self._has_key = False

    def step(self) -> None:
        """Begin to send to all people for whom something is due."""
        if not self._has_key:
            public_key()  # made at the first start
            self._has_key = True
        self._busy = {person: future for person, future in self._busy.items() if not future.done()}
        for person in people_due(timezone.now()):
            if person not in self._busy:
                self._busy[person] = self._sending.submit(_logged, person)


def _logged(person: UUID) -> None:
    try:
        send_due(person)
    except (DatabaseError, AuditUnavailable) as error:
        log.error("Pushes wait and are tried again: %s", error)
    except Exception:
        log.exception("A push failed and is tried again.")
    finally:
        connection.close()  # an idle thread must not keep a database connection
