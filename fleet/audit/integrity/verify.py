"""Verify the log: every record against the chain of digests, texts and details against their own digests.

The log is tamper-evident. An attacker who bypasses the triggers can change it, but verification finds the
change, unless the attacker computes the rest of the chain again. A comparison with heads that are kept
elsewhere also finds such a new chain, a missing end, and a beginning that was removed with a forged
checkpoint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, date, datetime
from typing import Annotated, Any, TypeVar
from uuid import UUID

import msgspec
from django.db import OperationalError, connection
from django.db.models import QuerySet
from django.utils import timezone as django_timezone
from msgspec import Struct

from fleet.audit.integrity import index_check, triggers
from fleet.audit.integrity.canonical import NO_ROBOT, content_digest, first_digest, next_digest
from fleet.audit.models import Chain, Record
from fleet.audit.retention import CLOCKS_DIFFER, RECORDS_KEPT_AT_LEAST

BATCH_SIZE = 5000  # records in memory
NOT_AS_WRITTEN = "is not what was written: it was changed or put in."
# Errors from reading cells with content that no console writes. SQLite stores any value in any column.
UNREADABLE = (ValueError, TypeError, AttributeError, OverflowError, OperationalError)
COLUMNS = [
    *(
        "id",
        "at",
        "day",
        "kind",
        "actor_id",
        "real_actor_id",
        "robot_id",
        "robot_name",
        "session_id",
        "fence",
    ),
    *("request_id", "of_id", "outcome", "parameters", "content_digest", "seq", "digest"),
    *("content__salt", "content__text", "content__data"),
]


class Finding(Struct, frozen=True):
    """A fault in the log: something is not as it was written."""

    chain: str  # the robot's name, or the name for records without robot
    number: int | None  # the order number of the record; None: there is no such record
    seq: int | None  # its place in the chain; None: the finding concerns no single place
    what: str

    def __str__(self) -> str:
        where = f"{self.chain}: "
        where += "" if self.number is None else f"record #{self.number} "
        where += "" if self.seq is None else f"(place {self.seq}) "
        return f"{where}{self.what}"


class Head(Struct, frozen=True):
    """The last record of a chain, to be kept elsewhere."""

    chain: UUID
    name: str
    seq: int
    digest: str
    at: datetime


class Verified(Struct):
    """Result of verifying some chains."""

    findings: list[Finding] = msgspec.field(default_factory=list)
    heads: list[Head] = msgspec.field(default_factory=list)
    records: int = 0


class Unreadable(Struct, frozen=True):
    """A record with a cell whose content does not fit its column."""

    id: int
    seq: Any
    digest: Any


class Removal(Struct, frozen=True):
    """A checkpoint's statement about the records before it."""

    through: int  # the place of the last removed record
    digest: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]  # of the last removed record
    removed: int  # the number of records that were removed with this checkpoint
    before: date  # all of them were older than this day


class Expired(Struct, frozen=True):
    """The log's statement about expired contents of one kind."""

    before: date  # all of them were older than this day


class Expiry(Struct, frozen=True):
    """The log's statement about expired contents."""

    kinds: dict[str, Expired]
    misdated: list[int] = []  # records with future days whose contents expired, too: the clock was ahead


class Erasure(Struct, frozen=True):
    """The log's statement about an erased person."""

    records: list[int]  # the records whose contents were removed


class RemovedContents(Struct):
    """Contents that were removed by the rules, according to the log's own records."""

    # by kind: contents of days before this one have expired
    before: dict[str, date] = msgspec.field(default_factory=dict)
    erased: set[int] = msgspec.field(default_factory=set)  # records whose contents were erased with a person
    # by record number: the day of the expiry record; the content may be missing if the record's day is later
    misdated: dict[int, date] = msgspec.field(default_factory=dict)

    def covers(self, record: Any) -> bool:
        """Return whether the content of this record may be missing."""
        return (
            record.day < self.before.get(record.kind, date.min)
            or record.id in self.erased
            or record.day > self.misdated.get(record.id, date.max)
        )


T = TypeVar("T")


def verify(chains: Iterable[Chain]) -> Verified:
    """Verify these chains. Others may write at the same time; robots are not delayed."""
    result, removed = Verified(), _removed_contents()
    for chain in chains:
        _Walk(chain, removed, result).go()
    return result


def verify_one(chain: Chain) -> Verified:
    """Verify one robot's chain, and the chain without robot, which records lawful removals."""
    return verify(Chain.objects.filter(pk__in=[chain.pk, NO_ROBOT]).order_by("name", "id"))


def verify_all() -> Verified:
    """Verify every chain, records without a chain, the triggers and the search index."""
    chains, findings = _chains()
    result = verify(chains)
    result.findings += [*findings, *_strays(chains), *_triggers(), *_index()]
    return result


def heads() -> Iterator[Head]:
    """Return the last record of each chain, unverified: to compare a later copy of the database with."""
    for chain in Chain.objects.order_by("name", "id"):
        row = _records(chain.pk).order_by("seq").values_list("seq", "digest", "at").last()
        if row is not None:
            yield Head(chain.pk, chain.name, *row)


def compare(heads: Iterable[Head]) -> Iterator[Finding]:
    """Compare the log with these heads, which were kept elsewhere. Return the differences."""
    for head in heads:
        name = head.name or _name(Chain(id=head.chain))
        records = _records(head.chain)
        there = records.filter(seq=head.seq).values_list("id", flat=True).first()
        if there is not None:
            if _cell(there, "digest") != head.digest:
                yield Finding(name, there, head.seq, "differs from the kept head.")
            continue
        first = _place(records.filter(seq__gt=0).order_by("seq").values_list("seq", flat=True).first())
        if first is None or head.seq > first:
            what = f"its end is cut off: it had {head.seq} records when the last was of {_time(head.at)}."
            yield Finding(name, None, None, what)
        elif what := _how_removed(head, _removal_before(first, records)):
            yield Finding(name, None, head.seq, what)


def _how_removed(head: Head, removal: Removal | None) -> str:
    """Return the fault in the removal of a head's record; blank: none."""
    was_of = f"it was of {_time(head.at)}"
    if removal is None:
        return f"was removed, and no valid checkpoint covers it: {was_of}."
    day = head.at.astimezone(UTC).date()
    if day >= removal.before and not _is_to_come(day):
        return f"was removed too early: {was_of}, and the checkpoint is for days before {removal.before}."
    if head.seq == removal.through and head.digest != removal.digest:
        return "differs in the checkpoint from the kept head."
    return ""


class _Walk:
    """Read a chain from its first kept record to its last, and collect the findings."""

    def __init__(self, chain: Chain, removed: RemovedContents, result: Verified) -> None:
        self._chain = chain
        self._records = _records(chain.pk)
        self._name = _name(chain)
        self._removed_contents = removed
        self._result = result
        self._seq = 0  # of the record before
        self._number = 0
        self._digest: Any = first_digest(chain.pk)  # of the record before; None: that record is missing
        self._doubted = False  # there is a finding about the record before
        self._removals: dict[int, Removal] = {}  # of valid checkpoints, by their record numbers

    def go(self) -> None:
        head = None
        for row in _rows(self._records.order_by("seq")):
            self._result.records += 1
            if _place(row.seq) is None:
                self._find(row, NOT_AS_WRITTEN)
                continue
            if row.seq != self._seq + 1:
                self._account_for_gap(row)
            what = self._what_is_wrong(row)
            if what:
                self._find(row, what)
            else:
                head = Head(self._chain.pk, self._chain.name, row.seq, row.digest, row.at)
            self._seq, self._number, self._digest, self._doubted = row.seq, row.id, row.digest, bool(what)
        if head is not None:
            self._result.heads.append(head)
        elif self._seq == 0:
            self._result.findings.append(Finding(self._name, None, None, "all of its records are missing."))

    def _account_for_gap(self, row: Any) -> None:
        """Explain the missing records before this one by a checkpoint, or report them as missing."""
        removal = _removal_before(row.seq, self._records) if self._seq == 0 else None
        if removal is not None:
            self._digest = removal.digest
            return
        first, last = self._seq + 1, row.seq - 1
        missing = (
            f"record {first} of this chain is"
            if first == last
            else f"records {first} to {last} of this chain are"
        )
        self._find(row, f"comes too early: {missing} missing.")
        self._digest = None

    def _what_is_wrong(self, row: Any) -> str:
        follows = None if isinstance(row, Unreadable) else _computed(next_digest, self._digest or "", row)
        if follows is None or (self._digest is not None and follows != row.digest):
            return self._why(row)
        return self._what_is_wrong_inside(row) or self._what_is_claimed(row)

    def _what_is_wrong_inside(self, row: Any) -> str:
        if row.content__salt is None:
            lost = row.content_digest and not self._removed_contents.covers(row)
            return "has lost its content too early." if lost else ""
        content = _computed(content_digest, row.content__salt, row.content__text, row.content__data)
        return "" if content == row.content_digest else "has another content than was written."

    def _what_is_claimed(self, row: Any) -> str:
        """Return the fault of a record's statement about removed content; blank: none."""
        if row.kind == "audit.expire" and _expiry(row) is None:
            return "reports contents that expired too early, or is not valid."
        if row.kind == "audit.checkpoint" and not self._counts(row):
            return "is no checkpoint of the console and is ignored."
        return ""

    def _counts(self, checkpoint: Any) -> bool:
        """Return whether the checkpoint is valid."""
        if checkpoint.id not in self._removals:  # not read yet, or appended since the last reading
            self._removals = _removals(self._records)
        return checkpoint.id in self._removals

    def _why(self, row: Any) -> str:
        if row.id <= self._number:
            return f"is out of order after #{self._number}: records were swapped."
        if self._doubted:
            return f"does not match record #{self._number} before it."
        return NOT_AS_WRITTEN

    def _find(self, row: Any, what: str) -> None:
        self._result.findings.append(Finding(self._name, row.id, _place(row.seq), what))


# --- the log's own statements about removals ----------------------------------------------------------


def _removal_before(seq: int, records: QuerySet[Record]) -> Removal | None:
    """Return the valid removal of the records before this place, if there is one."""
    before = [removal for removal in _removals(records).values() if removal.through == seq - 1]
    return before[-1] if before else None


def _removals(records: QuerySet[Record]) -> dict[int, Removal]:
    """Return the removals of a chain's valid checkpoints, by record number.

    Each removal starts where the previous one ended, and covers only records older than the minimum retention
    time.
    """
    counting: dict[int, Removal] = {}
    through = None  # the last place that the previous checkpoint removed; None: no checkpoint before is kept
    for row in _rows(records.filter(kind="audit.checkpoint").order_by("seq")):
        removal = _statement(row, Removal)
        if (
            removal is not None
            and row.day - removal.before >= RECORDS_KEPT_AT_LEAST
            and 0 < removal.removed <= removal.through < row.seq
            and through in (None, removal.through - removal.removed)
        ):
            counting[row.id] = removal
            through = removal.through
    return counting


def _expiry(row: Any) -> Expiry | None:
    """Return a record's statement about expired contents; None if it is invalid.

    A statement is invalid if contents expired on the day of the statement: no content is kept so briefly.
    """
    expiry = _statement(row, Expiry)
    lawful = expiry is not None and all(expired.before < row.day for expired in expiry.kinds.values())
    return expiry if lawful else None


def _removed_contents() -> RemovedContents:
    removed = RemovedContents()
    for row in _rows(Record.objects.filter(kind="audit.expire").order_by("id")):
        if (expiry := _expiry(row)) is None:
            continue
        for kind, expired in expiry.kinds.items():
            removed.before[kind] = max(removed.before.get(kind, date.min), expired.before)
        removed.misdated.update((number, row.day) for number in expiry.misdated if number < row.id)
    for row in _rows(Record.objects.filter(kind="audit.erase").order_by("id")):
        erasure = _statement(row, Erasure)
        removed.erased.update(number for number in (erasure.records if erasure else ()) if number < row.id)
    return removed


def _statement(row: Any, kind: type[T]) -> T | None:
    """Return a record's statement, if it is valid.

    A record of a future day is not: it could let much expire.
    """
    if isinstance(row, Unreadable) or not isinstance(row.day, date):
        return None
    return None if _is_to_come(row.day) else _computed(msgspec.convert, row.parameters, kind)


def _is_to_come(day: date) -> bool:
    """Return whether the day lies in the future, beyond the allowed clock difference."""
    return day > django_timezone.now().date() + CLOCKS_DIFFER


# --- reading cells that may contain anything ----------------------------------------------------------


def _rows(records: QuerySet[Record]) -> Iterator[Any]:
    """Return the records with their contents, in this order.

    After an unreadable one, records are read singly.
    """
    read = 0
    try:
        for row in records.values_list(*COLUMNS, named=True).iterator(BATCH_SIZE):
            read += 1
            yield row
    except UNREADABLE:
        for number in list(records.values_list("id", flat=True))[read:]:
            yield _row(number)


def _row(number: int) -> Any:
    this = Record.objects.filter(pk=number)
    try:
        return this.values_list(*COLUMNS, named=True).get()
    except UNREADABLE:
        return Unreadable(number, seq=_cell(number, "seq"), digest=_cell(number, "digest"))


def _cell(number: int, column: str) -> Any:
    return _computed(Record.objects.filter(pk=number).values_list(column, flat=True).get)


def _place(seq: Any) -> int | None:
    """Return the place in a chain; None if the value is no valid place."""
    return seq if isinstance(seq, int) and seq > 0 else None


def _computed(compute: Callable[..., T], *given: Any) -> T | None:
    """Return the result of `compute`; None for input that no console writes."""
    try:
        return compute(*given)
    except UNREADABLE:
        return None


def _records(chain: UUID) -> QuerySet[Record]:
    return Record.objects.filter(robot_id=None if chain == NO_ROBOT else chain)


# --- checks outside the chains --------------------------------------------------------------------------


def _chains() -> tuple[list[Chain], list[Finding]]:
    """Return all chains, and a finding for each chain that cannot be read."""
    ordered = Chain.objects.order_by("name", "id")
    chains: list[Chain] = []
    findings: list[Finding] = []
    for place in range(ordered.count()):
        try:
            chains += ordered[place : place + 1]
        except UNREADABLE:
            findings.append(Finding("database", None, None, "a chain cannot be read: it was changed."))
    return chains, findings


def _strays(chains: Iterable[Chain]) -> Iterator[Finding]:
    """Return a finding for each record whose robot has no chain."""
    ids = {chain.pk for chain in chains}
    strays = Record.objects.exclude(robot_id__in=ids - {NO_ROBOT})
    if NO_ROBOT in ids:
        strays = strays.exclude(robot_id=None)
    for number in strays.order_by("id").values_list("id", flat=True):
        robot_id, place = _cell(number, "robot_id"), _place(_cell(number, "seq"))
        yield Finding(str(robot_id or NO_ROBOT), number, place, "belongs to no chain: it was put in.")


def _triggers() -> Iterator[Finding]:
    for name, wrong in sorted(triggers.amiss(connection).items()):
        yield Finding("database", None, None, f"the trigger {name} {wrong}.")


def _index() -> Iterator[Finding]:
    for wrong in index_check.disagreements():
        yield Finding("database", None, None, wrong)


# --- texts ------------------------------------------------------------------------------------------------


def _name(chain: Chain) -> str:
    return "records without robot" if chain.pk == NO_ROBOT else f"{chain.name or chain.pk}"


def _time(at: datetime) -> str:
    return at.isoformat(timespec="seconds")
