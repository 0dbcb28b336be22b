"""Retention: recordings that are too old are deleted, each kind after its days. One that somebody keeps stays."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction

from fleet.audit.services import record
from robots.recordings.models import Kind, Place, Recording

AT_ONCE = 500


def remove_expired(now: datetime) -> Iterator[None]:
    """Delete them, and rows of files that are gone for as long as the log remembers. One small step at each `next`."""
    for kind in Kind:
        while _expire(kind, now):
            yield
    since = now - timedelta(days=settings.FLEET_AUDIT_KEEP_RECORDS_DAYS)
    Recording.objects.filter(place=Place.GONE, file="", object="", deleted_at__lt=since).delete()
    yield


@transaction.atomic
def _expire(kind: Kind, now: datetime) -> int:
    """Delete the oldest of a kind; the computer that has the files removes them soon. Return how many."""
    before = now - timedelta(days=settings.FLEET_RECORDINGS_KEEP_DAYS[kind])
    due = Recording.objects.filter(kind=kind, kept_at=None, ends_at__lt=before).exclude(place=Place.GONE)
    # Locked, so that nobody keeps one of them meanwhile
    oldest = due.order_by("begins_at").select_for_update(no_key=True)
    numbers = list(oldest.values_list("pk", flat=True)[:AT_ONCE])
    if numbers:
        Recording.objects.filter(pk__in=numbers).update(place=Place.GONE, deleted_at=now)
        parameters = {"recordings": kind, "before": before.isoformat(), "removed": len(numbers)}
        record("recording.expire", parameters=parameters)
    return len(numbers)
