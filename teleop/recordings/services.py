"""Keeping, sharing and deleting recordings. Each change is recorded in the same transaction."""

from __future__ import annotations

from datetime import timedelta
from typing import TypedDict
from uuid import UUID

import msgspec
from django.db import transaction
from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.services import record
from robots.access.models import Course
from robots.recordings.models import Place, Recording
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.models import RecordingShare
from teleop.recordings.selectors import sight_of

CONTINUED = timedelta(hours=6)  # a download that is continued later is on record again
MOST_SHARES = 50  # of one recording: its page lists them all


@transaction.atomic
def recording_keep(*, recording: Recording, keep: bool, actor: User) -> None:
    """Keep it until it is deleted by hand, or let retention have it again. Raises `NotDone`."""
    recording = _for_change(recording, actor)
    recording.kept_at = timezone.now() if keep else None
    recording.save(update_fields=["kept_at"])
    if keep:
        record("recording.keep", **_of(recording, actor))
    else:
        record("recording.let_go", **_of(recording, actor))


@transaction.atomic
def recording_share(
    *, recording: Recording, actor: User, person: User | None = None, course: Course | None = None
) -> RecordingShare:
    """Show the whole recording to a person or a course. Raises `NotDone`."""
    recording = _for_change(recording, actor)
    if recording.shares.count() >= MOST_SHARES:
        text = say("A recording is shared with at most {most} people and courses.", most=MOST_SHARES)
        raise NotDone(Refusal("too_many", text, "account"))
    share, made = RecordingShare.objects.get_or_create(
        recording=recording, person=person, course=course, defaults={"made_at": timezone.now()}
    )
    if made:
        record("recording.share", **_of(recording, actor, share))
    return share


@transaction.atomic
def recording_unshare(*, share: RecordingShare, actor: User) -> None:
    """End the sharing. Raises `NotDone`."""
    recording = _for_change(share.recording, actor)
    record("recording.unshare", **_of(recording, actor, share))
    share.delete()


@transaction.atomic
def recording_delete(*, recording: Recording, actor: User) -> None:
    """Delete a recording: from now on nobody sees it; its file is removed soon (`stores`). Raises `NotDone`."""
    recording = _for_change(recording, actor)
    recording.place, recording.deleted_at = Place.GONE, timezone.now()
    recording.save(update_fields=["place", "deleted_at"])
    record("recording.delete", **_of(recording, actor))


def recording_downloaded(*, recording: Recording, wanted: Struct, actor: User, continues: bool) -> None:
    """Record that a person downloads it, or a part. Raises `AuditUnavailable`: then nothing is sent.

    What continues a download that is on record is not recorded again.
    """
    facts = _of(recording, actor)
    facts["parameters"] |= {name: str(value) for name, value in msgspec.to_builtins(wanted).items() if value}
    lately = timezone.now() - CONTINUED
    known = Record.objects.filter(kind="recording.download", actor_id=str(actor.pk), at__gt=lately)
    if not (continues and facts["parameters"] in known.values_list("parameters", flat=True)):
        record("recording.download", **facts)


def _for_change(recording: Recording, actor: User) -> Recording:
    """Return the row, locked. Raises `NotDone` unless this person may change it."""
    found = Recording.objects.select_for_update(of=("self",), no_key=True).get(pk=recording.pk)
    sight = sight_of(actor, found)
    if sight is None:
        raise NotDone(Refusal("no_recording", "There is no such recording.", "account"))
    if not sight.may_change:
        text = (
            "A recording is kept, shared and deleted by its owner, "
            "by supervisors of the robot or the course, and by staff."
        )
        raise NotDone(Refusal("permission_denied", text, "account"))
    return found


class _Facts(TypedDict):
    actor: User
    robot_id: UUID
    robot_name: str
    session_id: UUID | None
    parameters: dict[str, str]


def _of(recording: Recording, actor: User, share: RecordingShare | None = None) -> _Facts:
    """Return the facts of a record about a recording, and about the person or course with whom it is shared."""
    facts = {"recording": str(recording.pk)}
    if share is not None and share.course is not None:
        facts["course"] = share.course.slug
    elif share is not None:
        facts["person"] = str(share.person_id)
    return {
        "actor": actor,
        "robot_id": recording.robot_id,
        "robot_name": recording.robot.name,
        "session_id": recording.session,
        "parameters": facts,
    }
