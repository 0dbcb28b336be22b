"""What the console has of a person, as they may read it and take it along: what they did, and what others did to them.

Of others' records they see what happened, when and with which robot; not who did it, nor what somebody else wrote.
"""

from __future__ import annotations

import heapq
import json
import re
from collections.abc import Iterator
from datetime import datetime
from enum import Enum
from itertools import islice
from typing import Any

from django.db.models import Q
from django.db.models.functions import Coalesce
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit import exports
from fleet.audit.listing import Page, Row, Selection, Wanted, rows_of
from fleet.audit.models import Record
from teleop.models import ControlSession

SESSIONS = 20  # of a page
RECORDS = 30
CHUNK = 500  # others' records in memory
TRIES = 5000  # to sign in, by anybody: the page reads no more of them

_TRIED = "account.sign_in_failed"

# Kinds of others' records that are about a person, whose identifier stands in this parameter.
_ABOUT = {
    "account.create": "user",
    "account.change": "user",
    "role.change": "user",
    "control.take_over": "holder",
    "audit.export": "person",
    _TRIED: "user",
}
# Those of which the details, too, are about nobody else: names and addresses of the account.
_DETAILED = {"account.create", "account.change", "role.change"}
_PERSONS = {"holder", "person", "to", "user"}  # parameters in which somebody's identifier may stand
_DIGESTS = {"name_digest", "address_digest"}  # of what somebody typed, and from where
_IDENTIFIER = re.compile("[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")


class Sessions(Struct, frozen=True):
    """Some of one's own control sessions, newest first."""

    shown: list[ControlSession]
    older: bool


def own_sessions(user: User, before: datetime | None) -> Sessions:
    """The newest, or those that began before."""
    sessions = ControlSession.objects.filter(user=user).select_related("robot").order_by("-started_at")
    if before is not None:
        sessions = sessions.filter(started_at__lt=before)
    found = list(sessions[: SESSIONS + 1])
    return Sessions(found[:SESSIONS], older=len(found) > SESSIONS)


def own_records(user: User, *, before: int | None, after: int | None) -> Page:
    """What this person did, newest first, each with what came of it."""
    return Selection(_of(user)).page(before=before, after=after, size=RECORDS)


class By(Enum):
    """Who made another's record, without a name."""

    CONSOLE = "the console"
    OTHER = "somebody else"
    UNKNOWN = "somebody who did not get in"


class About(Struct, frozen=True):
    """Others' records of a person, each with what came of it, newest first."""

    shown: list[Row]
    older: bool


def recorded_by_others(user: User, before: int | None) -> About:
    """The newest, or those below a number; tries to sign in of late alone, for strangers make any number of them."""
    numbers = _numbers_about(user, before, RECORDS + 1, tries_since=_tries_of_late())
    return About(rows_of(numbers[:RECORDS]), older=len(numbers) > RECORDS)


def by(record: Record) -> By:
    """Who made another's record: somebody, that is, and nobody by name."""
    if record.kind == _TRIED:
        return By.UNKNOWN
    return By.OTHER if record.actor_id else By.CONSOLE


def told_of(row: Row, user: User) -> dict[str, Any]:
    """The details of another's record that this person may see: nobody else's identifier."""
    told = _told_of(row.record, user)
    return told | _told_of(row.end, user) if row.end else told


def _told_of(record: Record, user: User) -> dict[str, Any]:
    whole = record.details if record.kind in _DETAILED else record.parameters
    return {
        name: value
        for name, value in whole.items()
        if name not in _DIGESTS
        and (name not in _PERSONS or value == str(user.pk) or not _IDENTIFIER.fullmatch(str(value)))
    }


def export_of(user: User) -> exports.ExportResponse:
    """All of that as a file. Raises `AuditUnavailable`: what cannot be recorded is not told."""
    return exports.response(
        Selection(_of(user)),
        _of(user),
        actor=user,
        name="your-data",
        format_=exports.Format.JSON_LINES,
        besides=_lines_about(user),
    )


def _lines_about(user: User) -> Iterator[tuple[str, int]]:
    before = None
    while numbers := _numbers_about(user, before, CHUNK):
        rows = rows_of(numbers)
        lines = (json.dumps(_exported(row, user), ensure_ascii=False) for row in rows)
        yield "".join(f"{line}\n" for line in lines), len(rows)
        before = numbers[-1]


def _exported(row: Row, user: User) -> dict[str, Any]:
    record = row.record
    in_own_session = record.session_id and record.kind not in _ABOUT
    return {
        "number": record.pk,
        "time": record.at.isoformat(),
        "kind": record.kind,
        "robot": {"id": str(record.robot_id), "name": record.robot_name} if record.robot_id else None,
        "by": by(record).value,
        "control_session": str(record.session_id) if in_own_session else None,
        "outcome": row.outcome,
        "details": told_of(row, user),
    }


def _tries_of_late() -> int:
    """The number of the oldest try to sign in that the page reads: by the index alone, whoever was meant."""
    tries = Record.objects.filter(kind=_TRIED).order_by("-pk").values_list("pk", flat=True)
    return next(iter(tries[TRIES - 1 : TRIES]), 0)


def _numbers_about(user: User, before: int | None, limit: int, tries_since: int = 0) -> list[int]:
    """At most so many, newest first: of each source by an index of its own, and merged."""
    person = str(user.pk)
    sessions = ControlSession.objects.filter(user=user).values("pk")
    sources = [
        Q(session_id__in=sessions),
        *(
            Q(kind=kind, pk__gte=tries_since if kind == _TRIED else 0, **{f"parameters__{name}": person})
            for kind, name in _ABOUT.items()
        ),
    ]
    others = Record.objects.exclude(actor=person).exclude(real_actor=person).order_by("-pk")
    # Requests alone; not by the index of outcomes, by which SQLite would look at half of the log.
    others = others.alias(request=Coalesce("of_id", 0)).filter(request=0)
    if before is not None:
        others = others.filter(pk__lt=before)
    found = [others.filter(source).values_list("pk", flat=True)[:limit] for source in sources]
    merged = dict.fromkeys(heapq.merge(*found, reverse=True))  # some are of two sources
    return list(islice(merged, limit))


def _of(user: User) -> Wanted:
    return Wanted(person=str(user.pk))
