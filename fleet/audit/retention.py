"""Retention: deletes texts and records whose time is over. Texts go by their class, whole records by checkpoints.

Each step is recorded, and is a small transaction, because bridges have records to write meanwhile. The functions are
iterators that do one step at each `next`.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from datetime import date, datetime, timedelta, timezone
from itertools import takewhile
from typing import NamedTuple

from django.conf import settings
from django.contrib.auth.models import AbstractUser
from django.db import connection, transaction
from django.db.models import Max, Min

from fleet.audit.command_line import SystemAccount
from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.kinds import KINDS
from fleet.audit.models import Chain, Content, Record
from fleet.audit.services import lock_chain, record

# For all settings: verification believes no other checkpoint.
RECORDS_KEPT_AT_LEAST = timedelta(days=365)
# Clocks differ by no more: a record of a later day was made by a wrong clock.
CLOCKS_DIFFER = timedelta(days=1)
# From one record to the next; after a longer gap the clock may be wrong.
SILENCE = timedelta(days=40)
CONTENTS_AT_ONCE = 500
RECORDS_AT_ONCE = 2000
INDEX_PAGES_AT_ONCE = 200
WAL_TRIES = 50

log = logging.getLogger(__name__)


def remove_expired(now: datetime) -> Iterator[None]:
    """Remove expired data, unless the clock is doubted: removed data cannot come back.

    A second call removes nothing.
    """
    today = now.astimezone(timezone.utc).date()
    _record_clock_set_back(today)
    if clock_is_doubted(today):
        _record_clock_doubt(today)
        return
    yield from expire_contents(today)
    yield from remove_old_records(today)
    yield from empty_wal()


# --- the clock ----------------------------------------------------------------------------------


def clock_is_doubted(today: date) -> bool:
    """Return whether the log's days leapt less than `SILENCE` ago and nobody has confirmed the clock.

    For a clock that is years ahead, everything looks old. A laboratory that was closed looks the same. So wait until
    the log has continued for `SILENCE` (the doubt is recorded each day), or until somebody confirms the clock. Records
    are compared by number, so that records between two faults of a clock also count.
    """
    old = Record.objects.filter(day__lte=today - SILENCE).order_by("-pk").values_list("pk", "day").first()
    if old is None:
        return False
    last, before = old
    going_on = Record.objects.filter(pk__gt=last, day__lte=today)
    since = going_on.aggregate(first=Min("day"))["first"] or today
    if since - before <= SILENCE:
        return False
    return not going_on.filter(kind="audit.clock", outcome="confirmed").exists()


def is_doubt_on_record(today: date) -> bool:
    """Return whether housekeeping doubts the clock at present, by its last record."""
    said = Record.objects.filter(kind="audit.clock").order_by("-pk").values_list("outcome", "day").first()
    return said is not None and said[0] == "doubted" and abs(today - said[1]) <= CLOCKS_DIFFER


def confirm_clock(actor: AbstractUser | SystemAccount) -> None:
    """Record that an admin confirmed the clock: data that is too old by it may expire."""
    record("audit.clock", actor=actor, outcome="confirmed")


def _record_clock_doubt(today: date) -> None:
    log.error(
        "nothing is taken out of the audit log: its days leapt by more than %d less than as many days ago, so the clock"
        " (today is %s) may be wrong. If it is right: manage.py confirm_clock",
        SILENCE.days,
        today,
    )
    if not Record.objects.filter(kind="audit.clock", outcome="doubted", day=today).exists():
        record("audit.clock", outcome="doubted")


def _record_clock_set_back(today: date) -> None:
    """Record that the clock was ahead; without other records, its own would be the only ones."""
    newest = Record.objects.order_by("-pk").values_list("day", flat=True).first()
    if newest is not None and newest > today + CLOCKS_DIFFER:
        record("audit.clock", outcome="set_back")


# --- contents -----------------------------------------------------------------------------------


def expire_contents(today: date) -> Iterator[None]:
    """Take out contents whose time is over; the record that says so comes first."""
    due = _misdated(today)
    beside = {"misdated": list(due)} if due else {}
    expired = {}
    for kind in KINDS:
        since = _kept_since(kind, today)
        if numbers := _due(kind, since):
            due += numbers
            expired[kind] = {"before": since.isoformat(), "removed": len(numbers)}
        yield
    if due:
        record("audit.expire", parameters={"kinds": expired, **beside})
        yield from take_out(due)


def take_out(numbers: Sequence[int]) -> Iterator[None]:
    """Take out the contents of these records, and their words out of the search."""
    for start in range(0, len(numbers), CONTENTS_AT_ONCE):
        Content.objects.filter(pk__in=numbers[start : start + CONTENTS_AT_ONCE]).delete()
        yield
    if numbers:
        yield from _tidy_search()


def _kept_since(kind: str, today: date) -> date:
    return today - timedelta(days=settings.FLEET_AUDIT_KEEP_DAYS[KINDS[kind].kept.value])


def _due(kind: str, since: date) -> list[int]:
    """The numbers of records of that kind, of earlier days, that have content."""
    midnight = datetime(since.year, since.month, since.day, tzinfo=timezone.utc)
    contents = Content.objects.filter(record__kind=kind, record__at__lt=midnight)
    return list(contents.values_list("pk", flat=True))


def _misdated(today: date) -> list[int]:
    """The numbers of records of days to come that have content, and after which something is recorded that is due.

    The clock was ahead when they were recorded; by their own day they would be kept until then.
    """
    contents = Content.objects.filter(record__day__gt=today + CLOCKS_DIFFER)
    kinds = dict(contents.values_list("pk", "record__kind"))
    last_due = {since: _last_before(since) for since in {_kept_since(kind, today) for kind in kinds.values()}}
    return [number for number, kind in kinds.items() if number < last_due[_kept_since(kind, today)]]


def _last_before(day: date) -> int:
    """The highest number of the records of earlier days."""
    return Record.objects.filter(day__lt=day).aggregate(last=Max("pk"))["last"] or 0


def _tidy_search() -> Iterator[None]:
    """Merge the pages of SQLite's index: it keeps removed words until then."""
    if connection.vendor != "sqlite":
        return
    pages = -INDEX_PAGES_AT_ONCE  # below zero: begin a merge of everything
    while _merge(pages):
        pages = INDEX_PAGES_AT_ONCE
        yield


def _merge(pages: int) -> bool:
    """One turn of merging; whether there was something left to do."""
    connection.ensure_connection()
    before = connection.connection.total_changes
    with connection.cursor() as cursor:
        cursor.execute(
            "INSERT INTO audit_content_search (audit_content_search, rank) VALUES ('merge', %s)", [pages]
        )
    return bool(connection.connection.total_changes - before >= 2)  # as the documentation of FTS5 has it


def empty_wal() -> Iterator[None]:
    """SQLite's write-ahead log keeps deleted content until it is emptied. Empty it without waiting for anybody.

    Where others read or write all the time it is tried again the next day.
    """
    for _ in range(WAL_TRIES):
        if connection.vendor != "sqlite" or connection.in_atomic_block or _wal_emptied():
            return
        yield
    log.warning("The write-ahead log of the database is in use; what was taken out stands in it for now.")


def _wal_emptied() -> bool:
    with connection.cursor() as cursor:
        cursor.execute("PRAGMA busy_timeout")
        [patience] = cursor.fetchone()
        # else writers would wait for readers
        cursor.execute("PRAGMA busy_timeout = 0")
        try:
            cursor.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            busy, *_frames = cursor.fetchone()
        finally:
            cursor.execute(f"PRAGMA busy_timeout = {patience}")
        return not busy


# --- whole records ------------------------------------------------------------------------------


class _Old(NamedTuple):
    """The limits of old records."""

    since: date  # records of earlier days
    through: int  # the highest number of these: up to it, records with future dates are old, too
    to_come: date  # the first of those days

    def has(self, number: int, day: date) -> bool:
        return day < self.since or (day >= self.to_come and number < self.through)


def remove_old_records(today: date) -> Iterator[None]:
    """Remove records that are older than records are kept. Each step leaves a checkpoint in the chain."""
    since = today - max(timedelta(days=settings.FLEET_AUDIT_KEEP_RECORDS_DAYS), RECORDS_KEPT_AT_LEAST)
    old = _Old(since, _last_before(since), today + CLOCKS_DIFFER + timedelta(days=1))
    removed = 0
    for chain in Chain.objects.all():
        more = True
        while more:
            gone = _remove_some(chain, old)
            removed += gone
            more = gone == RECORDS_AT_ONCE
            yield
    if removed:
        yield from _tidy_search()


@transaction.atomic
def _remove_some(chain: Chain, old: _Old) -> int:
    """Append a checkpoint and remove earlier records, in one transaction: a chain always begins at a checkpoint.

    How many went.
    """
    robot_id = None if chain.pk == NO_ROBOT else chain.pk
    records = Record.objects.filter(robot_id=robot_id)
    lock_chain(chain.pk)
    oldest = records.order_by("seq").values_list("pk", "day", "seq", "digest")[:RECORDS_AT_ONCE]
    going = list(takewhile(lambda row: old.has(row[0], row[1]), oldest))
    if not going:
        return 0
    *_, through, digest = going[-1]
    record(
        "audit.checkpoint",
        robot_id=robot_id,
        robot_name=chain.name,
        parameters={
            "through": through,
            "digest": digest,
            "removed": len(going),
            "before": old.since.isoformat(),
        },
    )
    gone = records.filter(seq__lte=through)
    Content.objects.filter(record__in=gone).delete()
    gone._raw_delete(gone.db)
    return len(going)
