"""Read the log page by page: filters, their records, and each request with its outcome.

A page needs only a few seeks in the database, however many records there are. Every filter has an index with
the record's number and with the columns of the other filters. Pages are cut by number ("older than 4711"),
not by counting rows. An index serves one kind and one person at a time, so several queries are read in
parallel and merged.
"""

from __future__ import annotations

import datetime
import heapq
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby, islice, product
from typing import Any
from uuid import UUID

from django.db import connection
from django.db.models import OuterRef, Q, QuerySet, Subquery
from django.db.models.lookups import IsNull
from msgspec import Struct
from msgspec.structs import replace

from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.kinds import KINDS
from fleet.audit.models import Record
from fleet.audit.reading.search import indexed, texts_among, texts_with
from fleet.base import zones

PAGE = 50  # rows
COUNTED = 1000  # rows that are counted; beyond this number the page shows only "more than"
FEW = 2000  # up to this number of candidates, their texts are read one by one
OUTCOMES = 500  # at most this many different outcomes to choose from
CONSOLE = "console"  # in the person filter: actions of the console itself

_NEAR = 31  # days
# Records of these kinds refer to another record, but have their own row: they are more than its outcome.
_OWN_ROW = ["gate.begin", "refusal"]
_IS_OUTCOME = Q(of__isnull=False) & ~Q(kind__in=_OWN_ROW)
_END_OF = {
    start: end
    for end in KINDS
    for start in (end.removesuffix("end") + "start", end.removesuffix("end") + "begin")
    if end.endswith(".end") and start in KINDS
}


class Wanted(Struct, frozen=True):
    """Filters of a list. Days are those of `zone` (blank: UTC), both included; blank and None mean any."""

    words: tuple[str, ...] = ()
    since: datetime.date | None = None
    until: datetime.date | None = None
    robot: UUID | None = None  # `NO_ROBOT`: records without robot
    person: str = ""  # an `Actor`'s id, or `CONSOLE`
    kind: str = ""
    outcome: str = ""
    session: UUID | None = None  # control session
    zone: str = ""
    # Most rows are viewings of cameras. A wanted `kind` is stronger.
    without_viewings: bool = False

    @property
    def days_utc(self) -> tuple[datetime.date | None, datetime.date | None]:
        """Return the first and last day in UTC, the log's days, that together contain the wanted days."""
        starts, ends = self.moments
        last = ends - datetime.timedelta.resolution if ends else None
        return (starts.date() if starts else self.since), (last.date() if last else self.until)

    @property
    def moments(self) -> tuple[datetime.datetime | None, datetime.datetime | None]:
        """Return start and end (not included) of the wanted days, if `zone` is set; else None."""
        if not self.zone:
            return None, None
        zone = zones.zone_of(self.zone)
        return (
            zones.start_of(self.since, zone) if self.since else None,
            zones.end_of(self.until, zone) if self.until else None,
        )


class Row(Struct, frozen=True):
    """A request with its outcome, or a record without outcome."""

    number: int  # pages are cut by this number
    record: Record
    end: Record | None

    @property
    def outcome(self) -> str:
        """Return the outcome; blank: unknown, or none was expected."""
        return self.end.outcome if self.end and self.end.outcome else self.record.outcome


class Page(Struct, frozen=True):
    """Some of the rows, newest first."""

    rows: list[Row]
    newer: bool  # whether there are newer rows
    older: bool  # whether there are older rows
    count: int | None = None  # number of all rows, at most `COUNTED` + 1; only on the first page


class Selection:
    """The wanted records. `kinds` are the kinds of the list; None: all."""

    def __init__(self, wanted: Wanted, kinds: Sequence[str] | None = None) -> None:
        self._wanted = wanted
        self._kinds = kinds

    def page(self, *, before: int | None = None, after: int | None = None, size: int = PAGE) -> Page:
        """Return the newest rows, or the next rows with numbers below `before`, or above `after`."""
        if after is not None:
            found = self.numbers(size + 1, after=after)
            shown = found[-size:]
            older = self.numbers(1, before=shown[-1] if shown else after + 1)
            return Page(rows_of(shown), newer=len(found) > size, older=bool(older))
        if before is not None:
            found = self.numbers(size + 1, before=before)
            newer = self.numbers(1, after=found[0] if found else before - 1)
            return Page(rows_of(found[:size]), newer=bool(newer), older=len(found) > size)
        found = self.numbers(COUNTED + 1)
        return Page(rows_of(found[:size]), newer=False, older=len(found) > size, count=len(found))

    def chunks(self, size: int) -> Iterator[list[Row]]:
        """Return all rows, newest first. Records that are written at the same time may be missing."""
        before: int | None = None
        while found := self.numbers(size, before=before):
            yield rows_of(found)
            before = found[-1]

    def numbers(self, limit: int, *, before: int | None = None, after: int | None = None) -> list[int]:
        """Return at most `limit` numbers of rows, newest first.

        With a wanted outcome: numbers of outcome records.
        """
        sources = self._texts() if self._wanted.words else self._streams()
        return _merged(
            [_cut(source, limit, before, after) for source in sources], limit, up=after is not None
        )

    def day_beside(self, *, later: bool) -> datetime.date | None:
        """Return the next day with rows after, or before, the wanted days.

        Words without index: only `_NEAR` days.
        """
        edge = self._wanted.until if later else self._wanted.since
        beside = _moved(edge, 1 if later else -1)
        if beside is None:
            return None
        # It is usually near, and searching a few days is quick.
        near = self._first_day(beside, _moved(beside, _NEAR if later else -_NEAR), later=later)
        if near is not None or not indexed(self._wanted.words):
            return near
        return self._first_day(beside, None, later=later)

    def _first_day(
        self, beside: datetime.date, far: datetime.date | None, *, later: bool
    ) -> datetime.date | None:
        since, until = (beside, far) if later else (far, beside)
        found = Selection(replace(self._wanted, since=since, until=until), self._kinds).numbers(
            1, after=0 if later else None
        )
        if not found:
            return None
        day, at = Record.objects.values_list("day", "at").get(pk=found[0])
        return zones.day_of(at, zones.zone_of(self._wanted.zone)) if self._wanted.zone else day

    # --- which records --------------------------------------------------------------------------

    def _streams(self) -> list[QuerySet[Record]]:
        """Return queries that have no row in common. Each uses one index."""
        return [
            Record.objects.filter(self._where, what, who)
            for what, who in product(self._whats(), self._whos())
        ]

    def _texts(self) -> list[QuerySet[Any]]:
        """Return queries for texts of the wanted rows with the wanted words; queries may share a text.

        If there are few wanted rows, their texts are read; else the search index is used.
        """
        few = Selection(replace(self._wanted, words=()), self._kinds).numbers(FEW + 1)
        if len(few) <= FEW:
            found = _kinds_of(few)
            return [texts_among([_row_of(*record) for record in found], self._wanted.words)]
        requests = Selection(replace(self._wanted, words=(), outcome=""), self._kinds)._streams()
        return [
            texts.filter(_there_is(stream.filter(pk=OuterRef("pk"))), outcome, self._within)
            for stream in requests
            if stream.exists()
            for outcome in self._outcome_wanted()
            for texts in texts_with(self._wanted.words)
        ]

    def _outcome_wanted(self) -> list[Q]:
        """Return conditions for the wanted outcome: in an outcome record, or in the record itself."""
        outcome = self._wanted.outcome
        if not outcome:
            return [Q()]
        kinds = {kind for kind, seen_one in self._telling() if seen_one == outcome}
        by = Record.objects.filter(outcome=outcome)
        conditions = []
        if others := kinds.difference(_OWN_ROW):
            conditions.append(_there_is(by.filter(of=OuterRef("pk"), kind__in=others)))
        if own := kinds.difference(_END_OF.values()):
            conditions.append(_there_is(by.filter(pk=OuterRef("pk"), kind__in=own)))
        return conditions

    @cached_property
    def _where(self) -> Q:
        wanted = self._wanted
        where = self._within
        (first, last), (starts, ends) = wanted.days_utc, wanted.moments
        if first:
            where &= Q(day__gte=first)
        if last:
            where &= Q(day__lte=last)
        # The time of day, which is in no index, matters only on the first and the last day.
        if starts:
            where &= Q(day__gt=first) | Q(at__gte=starts)
        if ends:
            where &= Q(day__lt=last) | Q(at__lt=ends)
        if wanted.robot:
            where &= Q(robot_id=None if wanted.robot == NO_ROBOT else wanted.robot)
        if wanted.session:
            where &= Q(session_id=wanted.session)
        return where

    @cached_property
    def _within(self) -> Q:
        """Limit the numbers to the wanted days: else an index would be read from its newest entry."""
        if not (self._wanted.since or self._wanted.until):
            return Q()
        since, until = self._wanted.days_utc
        first, last = _numbers_of(since or datetime.date.min, until or datetime.date.max)
        return Q(pk__gte=first, pk__lte=last)

    @property
    def _wanted_kinds(self) -> Sequence[str] | None:
        if not self._wanted.kind:
            return self._kinds
        return [self._wanted.kind] if self._kinds is None or self._wanted.kind in self._kinds else []

    def _telling(self) -> list[tuple[str, str]]:
        """Return the outcomes of the wanted kinds and of the kinds that end them."""
        return outcomes_of(KINDS if self._wanted_kinds is None else with_ends(self._wanted_kinds))

    def _whats(self) -> list[Q]:
        kinds = self._wanted_kinds
        if self._wanted.outcome:
            return [
                Q(kind=kind, outcome=outcome)
                for kind, outcome in self._telling()
                if outcome == self._wanted.outcome
            ]
        if kinds is None:
            return [~_IS_OUTCOME & ~Q(kind="camera.start") if self._wanted.without_viewings else ~_IS_OUTCOME]
        return [Q(kind=kind) & ~_IS_OUTCOME for kind in without_ends(kinds)]

    def _whos(self) -> list[Q]:
        person = self._wanted.person
        if not person:
            return [Q()]
        if person == CONSOLE:
            return [Q(actor=None)]
        as_another = Q(real_actor=person) & ~Q(actor=person)
        # Such records are rare: one check here avoids a further query for every kind.
        return [Q(actor=person), *([as_another] if Record.objects.filter(as_another).exists() else [])]


def outcomes_of(kinds: Iterable[str]) -> list[tuple[str, str]]:
    """Return the pairs of kind and outcome that records of these kinds have.

    The query skips repetitions by an index.
    """
    kinds = list(kinds)
    if not kinds:
        return []
    placeholders = ", ".join(["(%s)"] * len(kinds))
    next_one = "(SELECT MIN(outcome) FROM audit_record AS r WHERE r.kind = {0}.kind AND r.outcome > {1})"
    with connection.cursor() as cursor:
        cursor.execute(
            f"""
            WITH RECURSIVE asked (kind) AS (VALUES {placeholders}), seen (kind, outcome) AS (
                SELECT kind, {next_one.format("asked", "''")} FROM asked
                UNION ALL
                SELECT kind, {next_one.format("seen", "seen.outcome")} FROM seen WHERE outcome IS NOT NULL
            )
            SELECT kind, outcome FROM seen WHERE outcome IS NOT NULL LIMIT {OUTCOMES}
            """,  # noqa: S608  # no part of it comes from outside
            kinds,
        )
        return [(kind, outcome) for kind, outcome in cursor.fetchall()]


def without_ends(kinds: Iterable[str]) -> list[str]:
    """Return the kinds that have rows: those that are not the end of another kind."""
    return [kind for kind in kinds if kind not in _END_OF.values()]


def with_ends(kinds: Iterable[str]) -> list[str]:
    """Return the kinds and the kinds that end them."""
    kinds = list(kinds)
    return [*kinds, *(_END_OF[kind] for kind in kinds if kind in _END_OF)]


def _there_is(records: QuerySet[Record]) -> Q:
    """Return a condition that is checked for each text: EXISTS would become a join in PostgreSQL."""
    return Q(IsNull(Subquery(records.order_by().values("pk")[:1]), False))


def row_of(record: Record) -> Row:
    """Return the row of which a record is part."""
    return rows_of([record.pk])[0]


def _moved(day: datetime.date | None, days: int) -> datetime.date | None:
    """Return the date `days` later; None beyond the end of the calendar."""
    try:
        return None if day is None else day + datetime.timedelta(days)
    except OverflowError:
        return None


# --- numbers ----------------------------------------------------------------------------------


def _cut(source: QuerySet[Any], limit: int, before: int | None, after: int | None) -> Iterable[int]:
    if after is not None:
        source = source.filter(pk__gt=after).order_by("pk")
    elif before is not None:
        source = source.filter(pk__lt=before).order_by("-pk")
    else:
        source = source.order_by("-pk")
    return source.values_list("pk", flat=True)[:limit]


def _merged(sources: list[Iterable[int]], limit: int, *, up: bool) -> list[int]:
    """Return the first `limit` numbers of all sources, each once.

    The result is newest first, also with `up`.
    """
    each = (number for number, _same in groupby(heapq.merge(*sources, reverse=not up)))
    found = list(islice(each, limit))
    return found[::-1] if up else found


def _numbers_of(since: datetime.date, until: datetime.date) -> tuple[int, int]:
    """Return the lowest and the highest record number of these days; (1, 0) if there is none.

    Every day is checked, because numbers do not always grow with days: somebody may have set the clock back.
    """
    next_day = "(SELECT MIN(day) FROM audit_record AS r WHERE r.day > days.day AND r.day <= %s)"
    edge = "(SELECT {0}(r.id) FROM audit_record AS r WHERE r.day = days.day)"
    first, last = (connection.ops.adapt_datefield_value(day) for day in (since, until))
    with connection.cursor() as cursor:
        cursor.execute(
            f"""
            WITH RECURSIVE days (day) AS (
                SELECT MIN(day) FROM audit_record WHERE day >= %s AND day <= %s
                UNION ALL
                SELECT {next_day} FROM days WHERE day IS NOT NULL
            )
            SELECT MIN({edge.format("MIN")}), MAX({edge.format("MAX")}) FROM days
            """,  # noqa: S608  # no part of it comes from outside
            [first, last, last],
        )
        lowest, highest = cursor.fetchone()
    return (1, 0) if lowest is None else (lowest, highest)


# --- rows -------------------------------------------------------------------------------------


def rows_of(numbers: list[int]) -> list[Row]:
    """Return the rows of the records with these numbers.

    A row is the request and its outcome, if there is one.
    """
    found = {number: (of, kind) for number, of, kind in _kinds_of(numbers)}
    row_numbers = {number: _row_of(number, *found[number]) for number in numbers if number in found}
    records = _whole(Q(pk__in={*row_numbers, *row_numbers.values()}))
    ends = {end.of_id: end for end in _whole(Q(of__in=set(row_numbers.values())) & _IS_OUTCOME).values()}
    return [
        _row(number, records[number], records.get(row_numbers[number]), ends.get(row_numbers[number]))
        for number in numbers
        if number in records
    ]


def _row(number: int, found: Record, request: Record | None, end: Record | None) -> Row:
    if request is None:  # the request was removed before a checkpoint; its outcome is still there
        return Row(number, found, None)
    return Row(number, request, end if found.pk == request.pk else found)


def _kinds_of(numbers: Iterable[int]) -> QuerySet[Record, tuple[int, int | None, str]]:
    return Record.objects.filter(pk__in=numbers).values_list("pk", "of", "kind")


def _row_of(number: int, of: int | None, kind: str) -> int:
    return number if of is None or kind in _OWN_ROW else of


def _whole(which: Q) -> dict[int, Record]:
    """Return records with their people and kept content, oldest first."""
    records = Record.objects.filter(which).select_related("actor", "real_actor", "content").order_by("pk")
    return {record.pk: record for record in records}
