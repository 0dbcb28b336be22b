"""Export the log as a file: CSV for spreadsheets, JSON Lines for programs.

Exports are streamed and recorded.
"""

from __future__ import annotations

import asyncio
import csv
import io
import json
import logging
import time
from codecs import BOM_UTF8
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from datetime import datetime
from typing import Any, NamedTuple
from urllib.parse import quote
from zoneinfo import ZoneInfo

from asgiref.sync import sync_to_async
from django.contrib.auth.models import AbstractUser
from django.core.signals import request_started
from django.db.models import TextChoices
from django.http import StreamingHttpResponse
from django.utils import timezone
from msgspec.structs import asdict

from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.audit.reading import wording
from fleet.audit.reading.listing import Row, Selection, Wanted
from fleet.audit.services import record
from fleet.base import zones

log = logging.getLogger(__name__)

Facts = dict[str, Any]

CHUNK = 100  # rows in a piece: other requests of the process wait at most for one piece
# Pause after a piece, as a multiple of the piece's own time: if no other request came, and if one came.
PAUSE, PAUSE_BESIDE_OTHERS = 1.0, 9.0
LONGEST_PAUSE_S = 2.0  # a proxy closes a response that sends nothing for too long
# Without this mark, Excel reads the file in an old code page and shows wrong characters.
BOM = BOM_UTF8.decode()
# A cell that begins with one of these is a formula for spreadsheets, also full-width (OWASP, CSV injection).
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")

COLUMNS = [
    *(
        "number",
        "time_utc",
        "time_local",
        "robot",
        "robot_id",
        "person",
        "person_id",
        "really_by",
        "really_by_id",
    ),
    *("kind", "what", "subject", "outcome", "outcome_number", "outcome_time_utc", "outcome_time_local"),
    *("control_session", "fence", "request", "details", "outcome_details"),
]


class Format(TextChoices):
    """Formats of an export; the value is the file's extension."""

    CSV = "csv", "CSV"
    JSON_LINES = "jsonl", "JSON Lines"


class Export:
    """One export: its pieces (each is the text of some rows) and the number of rows sent."""

    def __init__(self, pieces: Iterator[tuple[str, int]], begun: Record, actor: AbstractUser) -> None:
        self._pieces = pieces
        self._begun = begun
        self._actor = actor
        self._count = 0
        self._complete = self._is_on_record = False

    def piece(self) -> str | None:
        """Return the text of the next rows; None after the last."""
        text, count = next(self._pieces, (None, 0))
        self._complete = text is None
        self._count += count
        return text

    def ended(self) -> None:
        """Record the outcome, once."""
        if self._is_on_record:
            return
        self._is_on_record = True
        outcome = "done" if self._complete else "broken_off"
        try:
            record(
                "audit.export",
                actor=self._actor,
                of=self._begun,
                outcome=outcome,
                parameters={"rows": self._count},
            )
        except AuditUnavailable as error:  # the rows are sent, and the beginning of the export is on record
            log.error("the outcome %s of export %s was not recorded: %s", outcome, self._begun.pk, error)


class ExportResponse(StreamingHttpResponse):
    """A response that records its end, also when the browser disconnects: the server always calls `close`."""

    def __init__(self, head: str, export: Export, **options: Any) -> None:
        super().__init__(_pieces(head, export), **options)
        self._export = export

    def close(self) -> None:
        super().close()
        self._export.ended()


async def _pieces(head: str, export: Export) -> AsyncIterator[bytes]:
    """Return the pieces. Each is read in a thread, because of its queries, after the last one was sent."""
    yield head.encode()
    asked, began_s = _requests.count, time.perf_counter()
    while (piece := await sync_to_async(export.piece)()) is not None:
        took_s = time.perf_counter() - began_s  # without the time that a slow browser needs to receive it
        yield piece.encode()
        before, asked = asked, _requests.count
        await asyncio.sleep(
            min(took_s * (PAUSE if asked == before else PAUSE_BESIDE_OTHERS), LONGEST_PAUSE_S)
        )
        began_s = time.perf_counter()
    await sync_to_async(export.ended)()


class _Requests:
    """Counts the requests of this process."""

    def __init__(self) -> None:
        self.count = 0
        request_started.connect(self._another)

    def _another(self, **_signal: Any) -> None:
        self.count += 1


_requests = _Requests()


class Content(NamedTuple):
    """The content of a file: its first text, then pieces, each with the text of some rows and their number."""

    format: Format
    head: str
    pieces: Iterable[tuple[str, int]]


def records(selection: Selection, format_: Format) -> Content:
    """Return the selected records, each request with its outcome."""
    zone = zones.viewers()  # read now: the rows are written after the request, when the zone is no longer set
    chunks = selection.chunks(CHUNK)
    if format_ is Format.CSV:
        return _csv(COLUMNS, ([_cells(row, zone) for row in rows] for rows in chunks))
    return _json_lines([_whole(row.record, row.end, zone) for row in rows] for rows in chunks)


def table(columns: Sequence[str], chunks: Iterable[list[Facts]], format_: Format) -> Content:
    """Return rows that are no records. Each has a value for each column."""
    if format_ is Format.CSV:
        return _csv(columns, ([facts.values() for facts in rows] for rows in chunks))
    return _json_lines(chunks)


def response(
    content: Content, wanted: Wanted, *, actor: AbstractUser, name: str, people: Sequence[str] = ()
) -> ExportResponse:
    """Return the file as a response. Raises `AuditUnavailable` if the export cannot be recorded.

    `people`: the identifiers of those whose data it contains, if it is about several.
    """
    asked = {key: value for key, value in asdict(wanted).items() if value and key != "words"}
    begun = record(
        "audit.export",
        actor=actor,
        parameters={
            "list": name,
            "format": content.format.value,
            **{key: str(value) for key, value in asked.items()},
            **({"people": list(people)} if people else {}),
        },
        private={"words": " ".join(wanted.words)} if wanted.words else None,
    )
    file = f"{name}-{timezone.now():%Y-%m-%d}.{content.format.value}"
    return ExportResponse(
        content.head,
        Export(iter(content.pieces), begun, actor),
        content_type=_MEDIA_TYPES[content.format],
        headers={
            "Content-Disposition": f"attachment; filename=\"{file}\"; filename*=UTF-8''{quote(file)}",
            "Cache-Control": "no-store",
        },
    )


# --- CSV ------------------------------------------------------------------------------------------


def safe_cell(value: str) -> str:
    """Return the cell so that spreadsheets show it as text: with an apostrophe before a formula."""
    return f"'{value}" if value.startswith(_FORMULA) else value


def _csv(columns: Sequence[str], chunks: Iterable[Sequence[Iterable[Any]]]) -> Content:
    pieces = ((_csv_lines(map(_safe, rows)), len(rows)) for rows in chunks)
    return Content(Format.CSV, BOM + _csv_lines([columns]), pieces)


def _safe(cells: Iterable[Any]) -> list[str]:
    return ["" if cell is None else safe_cell(str(cell)) for cell in cells]


def _csv_lines(lines: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, quoting=csv.QUOTE_ALL).writerows(lines)
    return text.getvalue()


def _cells(row: Row, zone: ZoneInfo) -> Iterator[Any]:
    record, end = row.record, row.end
    yield from (record.pk, _time(record), local(record.at, zone), record.robot_name, record.robot_id or "")
    yield from (record.actor_name, record.actor_id or "")
    yield from (record.real_actor.name if record.real_actor else "", record.real_actor_id or "")
    yield from (record.kind, wording.label(record.kind), wording.subject(record), row.outcome)
    yield from (end.pk, _time(end), local(end.at, zone)) if end else ("", "", "")
    yield from (record.session_id or "", "" if record.fence is None else record.fence, record.request_id)
    yield from (_json(record.details), _json(end.details) if end else "")


# --- JSON Lines -----------------------------------------------------------------------------------


def _json_lines(chunks: Iterable[list[Facts]]) -> Content:
    pieces = (("".join(f"{_json(row)}\n" for row in rows), len(rows)) for rows in chunks)
    return Content(Format.JSON_LINES, "", pieces)


def _whole(record: Record, end: Record | None, zone: ZoneInfo) -> dict[str, Any]:
    """Return all columns of a record; `ended` is the record of its outcome."""
    return {
        "number": record.pk,
        "time": _time(record),
        "time_local": local(record.at, zone),
        "kind": record.kind,
        "robot": {"id": _id(record.robot_id), "name": record.robot_name} if record.robot_id else None,
        "person": _person(record.actor_id, record.actor_name),
        "really_by": _person(record.real_actor_id, record.real_actor.name if record.real_actor else ""),
        "control_session": _id(record.session_id),
        "fence": record.fence,
        "request": _id(record.request_id),
        "of": record.of_id,
        "outcome": record.outcome,
        "details": record.details,
        "expired": wording.expired(record),
        "place": record.seq,
        "digest": record.digest,
        "ended": _whole(end, None, zone) if end else None,
    }


def _person(key: str | None, name: str) -> dict[str, str] | None:
    return {"id": key, "name": name} if key else None


def _id(value: Any) -> str | None:
    return None if value is None else str(value)


def _time(record: Record) -> str:
    return record.at.isoformat()


def local(moment: datetime, zone: ZoneInfo) -> str:
    """Return a moment as local time of a zone, with its offset from UTC.

    Exports have it beside the time in UTC.
    """
    return moment.astimezone(zone).isoformat()


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


_MEDIA_TYPES = {
    Format.CSV: "text/csv; charset=utf-8",
    Format.JSON_LINES: "application/jsonl; charset=utf-8",
}
