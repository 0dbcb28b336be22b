"""Files that must lose people who were erased: what their computer is told, and what it has done."""

from __future__ import annotations

from uuid import UUID

import msgspec
from django.db import transaction
from django.utils import timezone

from robots.recordings.models import Place, Recording
from robots.recordings.services import moment_of, taken_of
from robots.shared.records.record_sink import FileCut

MOST = 20  # at a time: the bridge asks again


def file_cuts(after: UUID | None = None, place: Place = Place.DIRECTORY) -> list[FileCut]:
    """Return which files must be cut, behind this recording in the order of ids. Their computers know them."""
    rows = Recording.objects.filter(stays__isnull=False, place=place).order_by("pk")
    if place == Place.DIRECTORY:
        rows = rows.exclude(file="")
    if after is not None:
        rows = rows.filter(pk__gt=after)
    return [FileCut(taken_of(row), msgspec.convert(row.stays, list[tuple[int, int]])) for row in rows[:MOST]]


@transaction.atomic
def file_cut(done: FileCut) -> None:
    """Note that the computer that has the file did this. If the file must lose more since then, it is cut again."""
    taken = done.taken
    row = Recording.objects.select_for_update(of=("self",), no_key=True).filter(pk=taken.recording).first()
    if row is None:
        return
    if (
        row.place == Place.GONE
    ):  # meanwhile: it is removed once more, in case that the new file came after that
        row.file = taken.name
    elif not taken.bytes:
        row.place, row.deleted_at, row.file, row.stays = Place.GONE, timezone.now(), "", None
    else:
        if row.stays == [list(time) for time in done.stays]:
            row.stays = None
        row.begins_at, row.ends_at = moment_of(taken.begins), moment_of(taken.ends)
        row.topics, row.bytes = msgspec.to_builtins(taken.topics), taken.bytes
        row.thumbnail = taken.thumbnail
    row.save(
        update_fields=[
            "place",
            "deleted_at",
            "file",
            "stays",
            "begins_at",
            "ends_at",
            "topics",
            "bytes",
            "thumbnail",
        ]
    )
