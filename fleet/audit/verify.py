"""Is the log as it was written? Every record is held against the chain of digests, what else is kept against its own.

The log is tamper-evident: whoever gets past the triggers can change it, but not without a finding here, unless they
compute the whole chain anew from there on. That, and a tail that was cut off, shows against heads kept elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import date, datetime
from typing import Any
from uuid import UUID

import msgspec
from django.db import connection
from msgspec import Struct

from fleet.audit import triggers
from fleet.audit.canonical import NO_ROBOT, content_digest, first_digest, next_digest
from fleet.audit.models import Chain, Record

AT_ONCE = 5000  # records in memory
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
    """One thing that is not as it was written."""

    chain: str  # the robot's name, or what stands for records without robot
    number: int | None  # the order number of the record; None: there is no such record
    seq: int | None  # its place in the chain; None: not of one place
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
    """What came of looking through some chains."""

    findings: list[Finding] = msgspec.field(default_factory=list)
    heads: list[Head] = msgspec.field(default_factory=list)
    records: int = 0


class Taken(Struct, frozen=True):
    """Which contents were lawfully taken out, by what the log itself says."""

    before: dict[str, date]  # by kind: those of earlier days had expired
    erased: frozenset[int]  # of these records, with a person

    def covers(self, record: Any) -> bool:
        """Whether it is right that the content of a record is gone."""
        return record.day < self.before.get(record.kind, date.min) or record.id in self.erased


def verify(chains: Iterable[Chain]) -> Verified:
    """Look through these chains. Others may write meanwhile; robots are not held up."""
    told, taken = Verified(), _taken()
    for chain in chains:
        _Walk(chain, taken, told).go()
    return told


def verify_all() -> Verified:
    """Look through every chain, and for what a chain cannot tell."""
    chains = list(Chain.objects.order_by("name", "id"))
    told = verify(chains)
    told.findings += [*_strays({chain.pk for chain in chains}), *_missing_triggers()]
    return told


def compare(heads: Iterable[Head]) -> Iterator[Finding]:
    """What is no longer as it was when these heads were kept."""
    for head in heads:
        robot_id = None if head.chain == NO_ROBOT else head.chain
        records = Record.objects.filter(robot_id=robot_id)
        first = records.order_by("seq").values_list("seq", flat=True).first()
        there = records.filter(seq=head.seq).values_list("id", "digest").first()
        name = head.name or _name(Chain(id=head.chain))
        if there is not None:
            number, digest = there
            if digest != head.digest:
                yield Finding(name, number, head.seq, "is another one than when the heads were kept.")
        elif first is None or head.seq > first:
            kept = head.at.isoformat(timespec="seconds")
            yield Finding(
                name,
                None,
                None,
                f"its end is cut off: it had {head.seq} records when the last was of {kept}.",
            )


class _Walk:
    """One way through a chain, from its first record that is kept to its last."""

    def __init__(self, chain: Chain, taken: Taken, told: Verified) -> None:
        self._chain = chain
        self._name = _name(chain)
        self._taken = taken
        self._told = told
        self._seq = 0  # of the record before
        self._number = 0
        self._digest: str | None = first_digest(chain.pk)  # None: not known, for it is missing
        self._doubted = False  # there is a finding about the record before

    def go(self) -> None:
        robot_id = None if self._chain.pk == NO_ROBOT else self._chain.pk
        rows = Record.objects.filter(robot_id=robot_id).order_by("seq").values_list(*COLUMNS, named=True)
        row = None
        for row in rows.iterator(AT_ONCE):
            if row.seq != self._seq + 1:
                self._account_for_gap(row)
            what = self._what_is_wrong(row)
            if what:
                self._find(row, what)
            self._seq, self._number, self._digest, self._doubted = row.seq, row.id, row.digest, bool(what)
            self._told.records += 1
        if row is None:
            self._told.findings.append(Finding(self._name, None, None, "all of its records are missing."))
        else:
            head = Head(self._chain.pk, self._chain.name, row.seq, row.digest, row.at)
            self._told.heads.append(head)

    def _account_for_gap(self, row: Any) -> None:
        """Records before this one are not there: a checkpoint says so, or they were removed."""
        checkpoint = _checkpoint(row) if self._seq == 0 else None
        if checkpoint is not None:
            self._digest = checkpoint
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
        if self._digest is not None and next_digest(self._digest, row) != row.digest:
            return self._why(row)
        if row.content__salt is None:
            lost = row.content_digest and not self._taken.covers(row)
            return "has lost its content before its time." if lost else ""
        if content_digest(row.content__salt, row.content__text, row.content__data) != row.content_digest:
            return "has another content than was written."
        return ""

    def _why(self, row: Any) -> str:
        if row.id <= self._number:
            return f"is out of order after #{self._number}: records were swapped."
        if self._doubted:
            return f"does not follow on #{self._number} as that is now."
        return "is not what was written: it was changed or put in."

    def _find(self, row: Any, what: str) -> None:
        self._told.findings.append(Finding(self._name, row.id, row.seq, what))


def _checkpoint(first: Any) -> str | None:
    """The digest that the first record kept follows on, if what was before it was removed as the log says."""
    checkpoints = Record.objects.filter(robot_id=first.robot_id, kind="audit.checkpoint")
    found = checkpoints.filter(parameters__through=first.seq - 1).order_by("id").last()
    return found.parameters["digest"] if found else None


def _taken() -> Taken:
    before: dict[str, date] = {}
    for told in (
        Record.objects.filter(kind="audit.expire").order_by("id").values_list("parameters", flat=True)
    ):
        for kind, expired in told["kinds"].items():
            before[kind] = max(before.get(kind, date.min), date.fromisoformat(expired["before"]))
    erasures = Record.objects.filter(kind="audit.erase").values_list("parameters", flat=True)
    return Taken(before, frozenset(number for told in erasures for number in told["records"]))


def _strays(chains: set[UUID]) -> Iterator[Finding]:
    for robot_id in Record.objects.order_by().values_list("robot_id", flat=True).distinct():
        if (robot_id or NO_ROBOT) not in chains:
            stray = Record.objects.filter(robot_id=robot_id).order_by("seq").values_list("id", "seq").first()
            number, seq = stray or (None, None)
            yield Finding(str(robot_id or NO_ROBOT), number, seq, "belongs to no chain: it was put in.")


def _missing_triggers() -> Iterator[Finding]:
    for name in sorted(triggers.missing(connection)):
        yield Finding("database", None, None, f"the trigger {name} is missing.")


def _name(chain: Chain) -> str:
    return "records without robot" if chain.pk == NO_ROBOT else str(chain)
