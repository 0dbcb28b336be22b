"""A person's own data, to read and to export: their records, records by others about them, and the
recordings that show them.

Records by others show the event, its time and the robot, but neither the author nor text that another person wrote.
"""

from __future__ import annotations

import heapq
import json
import re
from collections.abc import Iterator, Sequence
from datetime import datetime
from enum import Enum
from itertools import chain, islice
from typing import Any
from urllib.parse import urlencode
from zoneinfo import ZoneInfo

from django.db.models import Q
from django.db.models.functions import Coalesce
from django.urls import reverse
from msgspec import Struct
from msgspec.structs import replace

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.reading import exports
from fleet.audit.reading.listing import Page, Row, Selection, Wanted, rows_of
from fleet.base import zones
from robots.recordings.models import Recording
from teleop.models import ControlSession
from teleop.recordings.selectors import Part, own_parts, recordings_about

SESSIONS = 20  # per page
RECORDINGS = 20
RECORDS = 30
CHUNK = 500  # records by others in memory at once
TRIES = 5000  # failed sign-ins of all people; the page reads only the newest

_TRIED = "account.sign_in_failed"

# Kinds of records by others that are about a person; the parameter contains the person's identifier.
_ABOUT = {
    "account.create": "user",
    "account.change": "user",
    "account.second_factor": "user",
    "account.single_sign_on": "user",
    "token.make": "user",
    "token.end": "user",
    "role.change": "user",
    "control.take_over": "holder",
    "audit.export": "person",
    "booking.guest": "to",
    "recording.share": "person",
    "recording.unshare": "person",
    "push.remove": "person",
    "turn.call": "person",
    "turn.miss": "person",
    "turn.wait": "person",
    "turn.skip": "person",
    "turn.extend": "person",
    _TRIED: "user",
}
# Kinds whose details, too, are only about this person: names and addresses of the account.
_DETAILED = {"account.create", "account.change", "role.change"}
_PERSONS = {"holder", "person", "to", "user"}  # parameters that may contain a person's identifier
_DIGESTS = {"name_digest", "address_digest"}  # digests of typed names and of network addresses
_IDENTIFIER = re.compile("[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")


class Sessions(Struct, frozen=True):
    """A page of the person's control sessions, newest first."""

    shown: list[ControlSession]
    older: bool


def own_sessions(user: User, before: datetime | None) -> Sessions:
    """Return the newest control sessions, or the newest that began before `before`."""
    sessions = ControlSession.objects.filter(user=user).select_related("robot").order_by("-started_at")
    if before is not None:
        sessions = sessions.filter(started_at__lt=before)
    found = list(sessions[: SESSIONS + 1])
    return Sessions(found[:SESSIONS], older=len(found) > SESSIONS)


class OwnRecording(Struct, frozen=True):
    """The part of a recording that is a person's own data: all of it, or the time of their sessions."""

    recording: Recording
    part: Part

    @property
    def address(self) -> str:
        """Return where this part can be downloaded."""
        began = self.recording.begins_at
        part = {
            "from": (self.part.begins_at - began).total_seconds(),
            "to": (self.part.ends_at - began).total_seconds(),
        }
        return f"{reverse('api-recording-file', args=[self.recording.pk])}?{urlencode(part)}"


class Recordings(Struct, frozen=True):
    """A page of the recordings that show a person, newest first."""

    shown: list[OwnRecording]
    older: datetime | None  # to ask for the next page


def own_recordings(user: User, before: datetime | None, most: int = RECORDINGS) -> Recordings:
    """Return the person's parts of the newest recordings, or of the newest that began before `before`."""
    found = recordings_about(user).select_related("robot").order_by("-begins_at")
    if before is not None:
        found = found.filter(begins_at__lt=before)
    rows = list(found[: most + 1])
    shown = rows[:most]
    parts = zip(shown, own_parts(user, shown), strict=True)
    return Recordings(
        [OwnRecording(recording, part) for recording, seen in parts for part in seen],
        shown[-1].begins_at if len(rows) > most else None,
    )


def own_records(user: User, *, before: int | None, after: int | None, viewings: bool) -> Page:
    """Return the person's own records, newest first, each with its outcome; with or without viewings of cameras."""
    wanted = replace(_own_records(user), without_viewings=not viewings)
    return Selection(wanted).page(before=before, after=after, size=RECORDS)


def records_visible_to(user: User, wanted: Wanted) -> Wanted | None:
    """Limit a filter to records that `user` may read: staff all, others their own; None: no such record."""
    if user.is_staff:
        return wanted
    return replace(wanted, person=str(user.pk)) if wanted.person in ("", str(user.pk)) else None


class Author(Enum):
    """The author of a record by others, without a name."""

    CONSOLE = "the console"
    OTHER = "somebody else"
    UNKNOWN = "somebody who did not get in"


class RecordsByOthers(Struct, frozen=True):
    """A page of records by others about a person, newest first, each with its outcome."""

    shown: list[Row]
    older: bool


def recorded_by_others(user: User, before: int | None) -> RecordsByOthers:
    """Return the newest records, or those with numbers below `before`.

    Only recent failed sign-ins are read, because strangers can cause any number of them.
    """
    numbers = _numbers_about(user, before, RECORDS + 1, tries_since=_first_recent_try())
    return RecordsByOthers(rows_of(numbers[:RECORDS]), older=len(numbers) > RECORDS)


def author_of(record: Record) -> Author:
    """Return the author of a record by others, without a name."""
    if record.kind == _TRIED:
        return Author.UNKNOWN
    return Author.OTHER if record.actor_id else Author.CONSOLE


def visible_details(row: Row, user: User) -> dict[str, Any]:
    """Return the details that this person may see: no other person's identifier."""
    details = _visible_details(row.record, user)
    return details | _visible_details(row.end, user) if row.end else details


def _visible_details(record: Record, user: User) -> dict[str, Any]:
    whole = record.details if record.kind in _DETAILED else record.parameters
    return {
        name: value
        for name, value in whole.items()
        if name not in _DIGESTS
        and (name not in _PERSONS or value == str(user.pk) or not _IDENTIFIER.fullmatch(str(value)))
    }


def export_of(user: User) -> exports.ExportResponse:
    """Return all of the person's data as a file. Raises `AuditUnavailable`: an export must be recorded first."""
    content = exports.Content(exports.Format.JSON_LINES, "", _whole_data(user, zones.viewers()))
    return exports.response(content, _own_records(user), actor=user, name="your-data")


def export_of_many(people: Sequence[User], *, actor: User) -> exports.ExportResponse:
    """Return the data of these people as a file: a line with the account, then the lines of `export_of`."""
    zone = zones.viewers()

    def pieces() -> Iterator[tuple[str, int]]:
        for person in people:
            account = {"account": str(person.pk), "name": person.full_name}
            account |= {
                name: getattr(person, name) for name in ("username", "email", "time_zone", "language")
            }
            yield f"{json.dumps(account, ensure_ascii=False)}\n", 1
            yield from _whole_data(person, zone)

    content = exports.Content(exports.Format.JSON_LINES, "", pieces())
    keys = [str(person.pk) for person in people]
    return exports.response(content, Wanted(), actor=actor, name="people", people=keys)


def _whole_data(user: User, zone: ZoneInfo) -> Iterator[tuple[str, int]]:
    own = exports.records(Selection(_own_records(user)), exports.Format.JSON_LINES)
    return chain(own.pieces, _lines_about(user, zone), _lines_of_recordings(user, zone))


def _lines_of_recordings(user: User, zone: ZoneInfo) -> Iterator[tuple[str, int]]:
    before, more = None, True
    while more:
        page = own_recordings(user, before, most=CHUNK)
        lines = (json.dumps(_recording(one, user, zone), ensure_ascii=False) for one in page.shown)
        yield "".join(f"{line}\n" for line in lines), len(page.shown)
        before, more = page.older, page.older is not None


def _recording(own: OwnRecording, user: User, zone: ZoneInfo) -> dict[str, Any]:
    recording = own.recording
    return {
        "recording": str(recording.pk),
        "time": own.part.begins_at.isoformat(),
        "time_local": exports.local(own.part.begins_at, zone),
        "until": own.part.ends_at.isoformat(),
        "kind": recording.kind,
        "robot": {"id": str(recording.robot_id), "name": recording.robot.name},
        "reason": recording.reason if recording.person_id == user.pk else "",
        "topics": [topic["topic"] for topic in recording.topics],
        "file": own.address,
    }


def _lines_about(user: User, zone: ZoneInfo) -> Iterator[tuple[str, int]]:
    before = None
    while numbers := _numbers_about(user, before, CHUNK):
        rows = rows_of(numbers)
        lines = (json.dumps(_exported(row, user, zone), ensure_ascii=False) for row in rows)
        yield "".join(f"{line}\n" for line in lines), len(rows)
        before = numbers[-1]


def _exported(row: Row, user: User, zone: ZoneInfo) -> dict[str, Any]:
    record = row.record
    in_own_session = record.session_id and record.kind not in _ABOUT
    return {
        "number": record.pk,
        "time": record.at.isoformat(),
        "time_local": exports.local(record.at, zone),
        "kind": record.kind,
        "robot": {"id": str(record.robot_id), "name": record.robot_name} if record.robot_id else None,
        "by": author_of(record).value,
        "control_session": str(record.session_id) if in_own_session else None,
        "outcome": row.outcome,
        "details": visible_details(row, user),
    }


def _first_recent_try() -> int:
    """Return the number of the oldest failed sign-in that the page reads; the index alone answers this."""
    tries = Record.objects.filter(kind=_TRIED).order_by("-pk").values_list("pk", flat=True)
    return next(iter(tries[TRIES - 1 : TRIES]), 0)


def _numbers_about(user: User, before: int | None, limit: int, tries_since: int = 0) -> list[int]:
    """Return at most `limit` numbers, newest first. Each source uses its own index; the results are merged."""
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
    # Only records that are not outcomes. Without Coalesce, SQLite would use the index of outcomes and read
    # half of the log.
    others = others.alias(request=Coalesce("of_id", 0)).filter(request=0)
    if before is not None:
        others = others.filter(pk__lt=before)
    found = [others.filter(source).values_list("pk", flat=True)[:limit] for source in sources]
    merged = dict.fromkeys(heapq.merge(*found, reverse=True))  # a number can come from two sources
    return list(islice(merged, limit))


def _own_records(user: User) -> Wanted:
    return Wanted(person=str(user.pk))
