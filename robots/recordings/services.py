"""Rows of recordings, as the bridge reports their files."""

from __future__ import annotations

from datetime import UTC, datetime
from uuid import UUID

import msgspec
from django.db import transaction
from django.db.models import Q
from django.dispatch import Signal
from django.utils import timezone
from msgspec import structs

from fleet.accounts.models import ERASED, User
from robots.recordings.models import Place, Recording
from robots.shared.records.record_sink import FileChange, KeptEvent, TakenRecording

# Fields that row and report have alike
_SAME = (
    *(
        "kind",
        "bytes",
        "directory",
        "topics",
        "events",
        "controls",
        "course",
        "reason",
        "version",
        "dropped",
        "continues",
    ),
    *("cut", "ended_by", "thumbnail", "left_out"),
)
MOST_CHANGES = 200  # at a time: the bridge asks again
SOMEBODY = "somebody"  # who pressed stop, if the message was damaged
# Arguments: recording; owner_erased; named: its file names a person who was erased. Sent in the transaction that stores
# a new row.
stored = Signal()


@transaction.atomic
def recording_store(robot_id: UUID, taken: TakenRecording) -> Recording:
    """Store the row of a finished file. A second report of the same recording changes nothing.

    The report may come long after a person in it was erased: then the row does not have their names.
    """
    person = _owner(taken.person)
    is_erased = person is not None and person.username.startswith(ERASED)
    events = [_named_by_somebody(event) for event in taken.events]
    recording, is_new = Recording.objects.get_or_create(
        pk=taken.recording,
        defaults={
            "robot_id": robot_id,
            "person": None if is_erased else person,
            "kind": taken.kind,
            "begins_at": moment_of(taken.begins),
            "ends_at": moment_of(taken.ends),
            "session": _id(taken.session),
            "booking": _id(taken.booking),
            "course": taken.course,
            "reason": "" if is_erased else taken.reason,
            "topics": msgspec.to_builtins(taken.topics),
            "events": msgspec.to_builtins(events),
            "bytes": taken.bytes,
            "dropped": taken.dropped,
            "left_out": taken.left_out,
            "controls": msgspec.to_builtins(taken.controls),
            "cut": taken.cut,
            "ended_by": taken.ended_by[:300],
            "continues": taken.continues,
            "version": taken.version,
            "directory": taken.directory,
            "file": taken.name,
            "thumbnail": taken.thumbnail,
        },
    )
    if is_new:
        named = is_erased or events != taken.events
        stored.send(sender=Recording, recording=recording, owner_erased=is_erased, named=named)
    return recording


def taken_of(recording: Recording) -> TakenRecording:
    """Return what the row says now, as the report of its file."""
    named = {"person": recording.person_id}
    if recording.person_id is not None:  # they would lead to an owner who was erased
        named |= {"session": recording.session, "booking": recording.booking}
    facts = {name: getattr(recording, name) for name in _SAME} | {
        "recording": recording.pk,
        "robot": str(recording.robot_id),
        "begins": recording.begins_at.timestamp(),
        "ends": recording.ends_at.timestamp(),
        "name": recording.file,
    }
    return msgspec.convert(facts | {name: str(id or "") for name, id in named.items()}, TakenRecording)


def file_changes(after: UUID | None = None) -> list[tuple[UUID, FileChange]]:
    """Return what must be done with finished files, behind this recording in the order of ids.

    The computer that has a file knows it: its recordings may have moved there from another one.
    """
    kept = Q(place=Place.DIRECTORY, kept_at__isnull=False, file_kept=False)
    let_go = Q(place=Place.DIRECTORY, kept_at=None, file_kept=True)
    rows = Recording.objects.filter(Q(place=Place.GONE) | kept | let_go).exclude(file="").order_by("pk")
    if after is not None:
        rows = rows.filter(pk__gt=after)
    return [
        (number, "remove" if place == Place.GONE else "keep" if kept_at else "let_go")
        for number, place, kept_at in rows.values_list("pk", "place", "kept_at")[:MOST_CHANGES]
    ]


def file_changed(recording_id: UUID, change: FileChange) -> None:
    """Note that the bridge's computer did this."""
    if change == "remove":
        Recording.objects.filter(pk=recording_id, place=Place.GONE).update(file="")
    else:
        Recording.objects.filter(pk=recording_id).update(file_kept=change == "keep")


def recording_gone(recording_id: UUID) -> None:
    """Note that the file was removed on the bridge's computer. One in the object store stays there."""
    Recording.objects.filter(pk=recording_id, place=Place.DIRECTORY).update(
        place=Place.GONE, deleted_at=timezone.now(), file=""
    )


def object_begins(recording_id: UUID, key: str) -> bool:
    """Note that there may be an object of this file. Return False if it was deleted, or must be cut first."""
    there = Recording.objects.filter(pk=recording_id, place=Place.DIRECTORY, stays__isnull=True)
    return bool(there.update(object=key))


def object_stored(recording_id: UUID, key: str) -> bool:
    """Note that the object store has the file, which may be removed here. Return False as `object_begins`."""
    there = Recording.objects.filter(pk=recording_id, place=Place.DIRECTORY, stays__isnull=True)
    if there.update(place=Place.S3, object=key, file=""):
        return True
    # Its object may have been removed before it was whole
    Recording.objects.filter(pk=recording_id, place=Place.GONE).update(object=key)
    return False


def object_replaced(recording_id: UUID, key: str, new: str) -> bool:
    """Note that the object store has the file by another key now. Return False if something else happened meanwhile."""
    there = Recording.objects.filter(pk=recording_id, place=Place.S3, object=key)
    return bool(there.update(object=new))


def objects_to_remove() -> list[tuple[UUID, str]]:
    """Return deleted recordings that may have an object, each with its key."""
    rows = Recording.objects.filter(place=Place.GONE, object__gt="")
    return list(rows.values_list("pk", "object")[:MOST_CHANGES])


def object_removed(recording_id: UUID, key: str) -> None:
    """Note that the object is gone."""
    Recording.objects.filter(pk=recording_id, place=Place.GONE, object=key).update(object="")


def moment_of(seconds: float) -> datetime:
    """Return a moment from seconds since 1970."""
    return datetime.fromtimestamp(seconds, UTC)


def _owner(person: str) -> User | None:
    """Return the person with this id. Their erasure waits for the end of this transaction, or is over."""
    if (number := _id(person)) is None:
        return None
    return User.objects.select_for_update(no_key=True).filter(pk=number).first()


def _named_by_somebody(event: KeptEvent) -> KeptEvent:
    """Return an event without a name that no account has: that of a person who was erased since then, or renamed."""
    by = event.by
    if not by or by == SOMEBODY or User.objects.filter(Q(full_name=by) | Q(username=by)).exists():
        return event
    return structs.replace(event, by="", text="")


def _id(text: str) -> UUID | None:
    """Return an id; None: there is none."""
    try:
        return UUID(text)
    except ValueError:
        return None
