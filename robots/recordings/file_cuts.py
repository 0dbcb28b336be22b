"""Files that must lose people who were erased: what their computer is told, and what it has done."""

from __future__ import annotations

from uuid import UUID

import msgspec
from django.db import transaction
from django.utils import timezone
from msgspec import structs

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
    return [_cut_of(row) for row in rows[:MOST]]


def _cut_of(row: Recording) -> FileCut:
    taken, stays = taken_of(row), msgspec.convert(row.stays, list[tuple[int, int]])
    controls = [
        one
        for one in taken.controls or ()
        if any(begin <= (one.begins + one.ends) / 2 * 1e9 < end for begin, end in stays)
    ]
    return FileCut(structs.replace(taken, controls=controls), stays)


@transaction.atomic
def file_cut(done: FileCut) -> None:
    """Note that the computer that has the file did this. If the file must lose more since then, it is cut again."""
    taken = done.taken
    row = Recording.objects.select_for_update(of=("self",), no_key=True).filter(pk=taken.recording).first()
    if row is None:
        return
    if row.place == Place.GONE:
        row.file = taken.name  # the new file may have come after the removal: it is removed once more
    elif not taken.bytes:
        row.place, row.deleted_at, row.file, row.stays = Place.GONE, timezone.now(), "", None
    else:
        if row.stays == [list(time) for time in done.stays]:
            row.stays = None
        row.begins_at, row.ends_at = moment_of(taken.begins), moment_of(taken.ends)
        row.topics, row.bytes = msgspec.to_builtins(taken.topics), taken.bytes
        row.thumbnail = taken.thumbnail
    row.save()
