"""Retention: delete contents and records that are too old.

Contents expire by their retention class. Whole records are removed up to a checkpoint. Removals are recorded.
Each step is a small transaction, because bridges write records at the same time. The functions are iterators
that do one step at each `next`.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from datetime import UTC, date, datetime, timedelta
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

# No setting can be lower: verification refuses a checkpoint that removed records younger than this.
RECORDS_KEPT_AT_LEAST = timedelta(days=365)
# The largest allowed difference of clocks: a record of a later day was made with a wrong clock.
CLOCKS_DIFFER = timedelta(days=1)
# The longest gap between two records; after a longer gap the clock may be wrong.
SILENCE = timedelta(days=40)
CONTENTS_AT_ONCE = 500
RECORDS_AT_ONCE = 2000
INDEX_PAGES_AT_ONCE = 200
WAL_TRIES = 50

log = logging.getLogger(__name__)


def remove_expired(now: datetime) -> Iterator[None]:
    """Remove expired data, unless the clock may be wrong: removed data cannot be restored.

    A second call removes nothing.
    """
    today = now.astimezone(UTC).date()
    _record_clock_set_back(today)
    if clock_is_doubted(today):
        _record_clock_doubt(today)
        return
    yield from expire_contents(today)
    yield from remove_old_records(today)
    yield from empty_wal()


# --- the clock ----------------------------------------------------------------------------------


def clock_is_doubted(today: date) -> bool:
    """Return whether the clock may be wrong: the log had a gap over `SILENCE`, less than `SILENCE` ago.

    With a clock that is years ahead, everything looks too old. A laboratory that was closed for months leaves
    the same gap. So nothing is removed until the log has continued for `SILENCE` (the doubt is
    recorded each day), or until somebody confirms the clock. Records are compared in the order of their
    numbers, so that records between two faults of a clock also count.
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
    """Return whether housekeeping now doubts the clock, according to its last record."""
    said = Record.objects.filter(kind="audit.clock").order_by("-pk").values_list("outcome", "day").first()
    return said is not None and said[0] == "doubted" and abs(today - said[1]) <= CLOCKS_DIFFER


def confirm_clock(actor: AbstractUser | SystemAccount) -> None:
    """Record that an admin confirmed the clock: data that is too old by this clock may expire."""
    record("audit.clock", actor=actor, outcome="confirmed")


def _record_clock_doubt(today: date) -> None:
    log.error(
        "The audit log had a gap of more than %d days, less than %d days ago. The clock may be wrong (today is %s), so"
        " nothing is removed. If the clock is right: manage.py confirm_clock",
        SILENCE.days,
        SILENCE.days,
        today,
    )
    if not Record.objects.filter(kind="audit.clock", outcome="doubted", day=today).exists():
        record("audit.clock", outcome="doubted")


def _record_clock_set_back(today: date) -> None:
    """Record that the clock was ahead.

    This record gives the log a record of today, even if there is no other.
    """
    newest = Record.objects.order_by("-pk").values_list("day", flat=True).first()
    if newest is not None and newest > today + CLOCKS_DIFFER:
        record("audit.clock", outcome="set_back")


# --- contents -----------------------------------------------------------------------------------


def expire_contents(today: date) -> Iterator[None]:
    """Record which contents expire, then remove them."""
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
    """Remove the contents of these records, also from the search index."""
    for start in range(0, len(numbers), CONTENTS_AT_ONCE):
        Content.objects.filter(pk__in=numbers[start : start + CONTENTS_AT_ONCE]).delete()
        yield
    if numbers:
        yield from _tidy_search()


def _kept_since(kind: str, today: date) -> date:
    return today - timedelta(days=settings.FLEET_AUDIT_KEEP_DAYS[KINDS[kind].kept.value])


def _due(kind: str, since: date) -> list[int]:
    """Return the numbers of records of this kind that are older than this day and have content."""
    midnight = datetime(since.year, since.month, since.day, tzinfo=UTC)
    contents = Content.objects.filter(record__kind=kind, record__at__lt=midnight)
    return list(contents.values_list("pk", flat=True))


def _misdated(today: date) -> list[int]:
    """Return the numbers of records with future days whose contents are due, because a later record is due.

    The clock was ahead when they were recorded. By their own day they would be kept too long.
    """
    contents = Content.objects.filter(record__day__gt=today + CLOCKS_DIFFER)
    kinds = dict(contents.values_list("pk", "record__kind"))
    last_due = {since: _last_before(since) for since in {_kept_since(kind, today) for kind in kinds.values()}}
    return [number for number, kind in kinds.items() if number < last_due[_kept_since(kind, today)]]


def _last_before(day: date) -> int:
    """Return the highest number of the records that are older than this day."""
    return Record.objects.filter(day__lt=day).aggregate(last=Max("pk"))["last"] or 0


def _tidy_search() -> Iterator[None]:
    """Merge the pages of SQLite's search index: until then, it keeps removed words."""
    if connection.vendor != "sqlite":
        return
    pages = -INDEX_PAGES_AT_ONCE  # a negative number starts a merge of the whole index
    while _merge(pages):
        pages = INDEX_PAGES_AT_ONCE
        yield


def _merge(pages: int) -> bool:
    """Merge some pages. Return whether there was something to merge."""
    connection.ensure_connection()
    before = connection.connection.total_changes
    with connection.cursor() as cursor:
        cursor.execute(
            "INSERT INTO audit_content_search (audit_content_search, rank) VALUES ('merge', %s)", [pages]
        )
    return bool(connection.connection.total_changes - before >= 2)  # according to the documentation of FTS5


def empty_wal() -> Iterator[None]:
    """Empty SQLite's write-ahead log, which still contains deleted content.

    It never waits for readers or writers: if they use the database all the time, it is tried again the next
    day.
    """
    for _ in range(WAL_TRIES):
        if connection.vendor != "sqlite" or connection.in_atomic_block or _wal_emptied():
            return
        yield
    log.warning("The write-ahead log of the database is in use; removed content stays in it for now.")


def _wal_emptied() -> bool:
    with connection.cursor() as cursor:
        cursor.execute("PRAGMA busy_timeout")
        [patience] = cursor.fetchone()
        # with a timeout, this statement would wait for readers, and writers would wait for it
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

    since: date  # records of days before this one are old
    through: int  # the highest number of an old record: below it, records with future days are old, too
    to_come: date  # the first future day

    def has(self, number: int, day: date) -> bool:
        return day < self.since or (day >= self.to_come and number < self.through)


def remove_old_records(today: date) -> Iterator[None]:
    """Remove records that are too old. Each step leaves a checkpoint in the chain."""
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
    """Append a checkpoint and remove earlier records, in one transaction: each removal has a checkpoint.

    Return the number of removed records.
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
