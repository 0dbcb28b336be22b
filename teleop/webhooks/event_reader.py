"""Make deliveries from records of the audit log.

A webhook stores the number of the last record read for it.
"""

from __future__ import annotations

from datetime import timedelta
from typing import NamedTuple
from uuid import UUID

from django.db import transaction
from django.db.models import QuerySet
from django.utils import timezone

from fleet.audit.models import Record
from fleet.audit.services import wait_for_writers
from fleet.base.database import rows
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks.events import is_event

BATCH_SIZE = 500  # records of one round
NOTED_AFTER = 500  # records without an event, until the number read is stored
OLDEST = timedelta(days=7)  # after a long pause, older events are not sent


class Line(NamedTuple):
    """The columns of a record that decide whether it is an event."""

    pk: int
    kind: str
    of: int | None
    robot: UUID | None


def newest_record() -> int:
    """Return the highest record number of the log; 0: the log is empty."""
    return rows.read("SELECT MAX(id) FROM audit_record", [])[0][0] or 0


class EventReader:
    """Reads the log for all webhooks of one process.

    Events and the number of the last record read are stored in one transaction. Without events, the number is
    stored only every `NOTED_AFTER` records: a write here would delay the audit log of the robots, which is in
    the same database.
    """

    def __init__(self) -> None:
        self._read_to: dict[UUID, int] = {}

    def read(self, webhook: Webhook) -> int:
        """Store the deliveries of the records since the last call. Return how many records were read."""
        start = max(webhook.read_to, self._read_to.get(webhook.pk, 0))
        lines = lines_after(start)
        if not lines:
            return 0
        end = lines[-1].pk
        robots = set(webhook.robots.values_list("pk", flat=True))
        events = [
            line
            for line in lines
            if is_event(line.kind, line.of, webhook.kinds) and (not robots or line.robot in robots)
        ]
        if (events or end - webhook.read_to >= NOTED_AFTER) and not _store(webhook, events, end):
            return 0
        self._read_to[webhook.pk] = end
        return len(lines)


def lines_after(start: int) -> list[Line]:
    """Return the next records, without gaps that a writer may still fill.

    Gaps are possible because a record gets its number before it is committed.
    """
    later = Record.objects.filter(pk__gt=start).order_by("pk")
    lines = _lines(later[:BATCH_SIZE])
    if lines and lines[-1].pk - start > len(lines):
        wait_for_writers()
        lines = _lines(later.filter(pk__lte=lines[-1].pk))
    return lines


def _lines(records: QuerySet[Record]) -> list[Line]:
    return [Line(*row) for row in records.values_list("pk", "kind", "of_id", "robot_id")]


def _store(webhook: Webhook, events: list[Line], end: int) -> bool:
    """Store deliveries and the number `end`. Return False if the webhook was paused or deleted since."""
    now = timezone.now()
    young = set(
        Record.objects.filter(pk__in=[line.pk for line in events], at__gt=now - OLDEST).values_list(
            "pk", flat=True
        )
    )
    with transaction.atomic():
        if Webhook.objects.select_for_update().filter(pk=webhook.pk, paused_at=None).first() is None:
            return False
        deliveries = [
            WebhookDelivery(webhook=webhook, record=line.pk, kind=line.kind, made_at=now, due_at=now)
            for line in events
            if line.pk in young
        ]
        # Another process may have read the same records.
        WebhookDelivery.objects.bulk_create(deliveries, ignore_conflicts=True)
        Webhook.objects.filter(pk=webhook.pk, read_to__lt=end).update(read_to=end)
    return True
