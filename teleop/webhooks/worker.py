"""The threads of webhooks in a housekeeping process: one reads the log, and each webhook has one to send.

So a receiver that hangs delays neither housekeeping nor another receiver.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from uuid import UUID

from django.db import DatabaseError, connection
from django.utils import timezone

from fleet.audit.errors import AuditUnavailable
from teleop.models import Webhook
from teleop.webhooks.delivery import active_webhooks, due, send_due
from teleop.webhooks.event_reader import EventReader
from teleop.webhooks.services import MOST

log = logging.getLogger(__name__)


class WebhookWorker:
    """Reads events and sends them. Its process calls `step` every second."""

    def __init__(self) -> None:
        self._reader = EventReader()
        self._reading = ThreadPoolExecutor(max_workers=1, thread_name_prefix="webhook-events")
        self._round: Future[None] | None = None
        self._sending = ThreadPoolExecutor(max_workers=MOST, thread_name_prefix="webhook")
        self._busy: dict[UUID, Future[None]] = {}

    def step(self) -> None:
        """Start a round in the thread that reads, unless the last round still runs."""
        if self._round is None or self._round.done():
            self._round = self._reading.submit(_logged, self._work)

    def _work(self) -> None:
        self._busy = {key: future for key, future in self._busy.items() if not future.done()}
        for webhook in list(active_webhooks()):
            _logged(partial(self._work_for, webhook))

    def _work_for(self, webhook: Webhook) -> None:
        self._reader.read(webhook)
        if webhook.pk not in self._busy and due(webhook.pk, timezone.now()).exists():
            self._busy[webhook.pk] = self._sending.submit(_logged, partial(send_due, webhook.pk))


def _logged(work: Callable[[], object]) -> None:
    try:
        work()
    except (DatabaseError, AuditUnavailable) as error:
        log.error("Webhooks wait and are tried again: %s", error)
    except Exception:
        log.exception("A webhook failed and is tried again.")
    finally:
        connection.close()  # an idle thread must not keep a database connection
