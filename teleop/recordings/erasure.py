"""Recordings of a person who is erased: theirs are deleted; others lose their names and the time of their sessions.

From then on pages and downloads show neither. The computer that has the file cuts it soon (`Recording.stays`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator
from functools import partial
from typing import Any
from uuid import UUID

from django.db import transaction
from django.db.models import Q, TextField
from django.db.models.functions import Cast
from django.dispatch import receiver
from django.utils import timezone

from fleet.accounts.models import ERASED, User
from fleet.accounts.services import erased
from robots.recordings.models import Place, Recording
from robots.recordings.services import stored
from teleop.models import ControlSession, RecordingShare
from teleop.recordings.selectors import Part, Sight, parts_of, recordings_about, sessions_in, without_erased
from teleop.recordings.times import ns_of

END_NS = 2**63 - 1  # of time
ROUNDED_NS = 1_000_000  # by which the row's ends may differ from those of its file


@receiver(erased)
def _forget(*, user: User, names: Collection[str], **_options: Any) -> None:
    """Delete what shows nobody else; in the rest take out the sessions and the names, also in others' recordings."""
    RecordingShare.objects.filter(person=user).delete()
    known = {name for name in names if name.strip()}
    for recording in recordings_about(user):
        if _shows_others(recording, is_owner=recording.person_id == user.pk):
            _take_out(recording, user, known)
        else:
            _delete(recording)
    for recording in _naming(known):
        _take_out(recording, user, known)


@receiver(stored)
def _forget_late(*, recording: Recording, owner_erased: bool, named: bool, **_options: Any) -> None:
    """Do the same with a recording whose file was reported after the erasure. An erasure waits, or is over."""
    people = {session.user_id for session in sessions_in(recording)}
    locked = User.objects.select_for_update(no_key=True).filter(pk__in=people).order_by("pk")
    is_shown = any(person.username.startswith(ERASED) for person in locked)
    if not (is_shown or named):
        return
    if _shows_others(recording, is_owner=owner_erased):
        _take_out(recording, None, ())
    else:
        _delete(recording)


def _delete(recording: Recording) -> None:
    Recording.objects.filter(pk=recording.pk).update(
        place=Place.GONE, deleted_at=timezone.now(), person=None, reason="", events=[], stays=None
    )
    transaction.on_commit(partial(_remove_downloads, recording.pk))


def _remove_downloads(recording: UUID) -> None:
    from teleop.recordings import downloads  # its libraries are not for every process that loads this app

    downloads.remove_of(recording)


def _shows_others(recording: Recording, is_owner: bool) -> bool:
    """Return whether it shows somebody else's session, or, if another person owns it, any time without one."""
    if is_owner:
        return any(not session.user.username.startswith(ERASED) for session in sessions_in(recording))
    whole = [Part(recording.begins_at, recording.ends_at)]
    return without_erased([Sight(recording, True, whole, False)]) != [None]


def _take_out(recording: Recording, user: User | None, names: Collection[str]) -> None:
    gone = [
        gap
        for one in sessions_in(recording)
        if one.user.username.startswith(ERASED)
        for gap in _gaps(one, recording)
    ]
    recording.events = [
        event | {"by": "", "text": ""} if _names_one(event, names) else event
        for event in recording.events
        if not any(begin <= event["at"] * 1e9 < end for begin, end in gone)
    ]
    if user is not None and recording.person_id == user.pk:
        recording.person, recording.reason = None, ""
    elif _word_of(names, recording.reason):
        recording.reason = ""
    recording.stays = _around(gone)
    recording.save(update_fields=["events", "person", "reason", "stays"])
    transaction.on_commit(partial(_remove_downloads, recording.pk))


def _gaps(session: ControlSession, recording: Recording) -> Iterator[tuple[int, int]]:
    """Yield the times of a recording that show a session; the row's ends are rounded, so those times go beyond them."""
    for part in parts_of(session, recording):
        begin_ns, end_ns = ns_of(part.begins_at), ns_of(part.ends_at) + 1
        begins, ends = part.begins_at <= recording.begins_at, part.ends_at >= recording.ends_at
        yield begin_ns - ROUNDED_NS if begins else begin_ns, END_NS if ends else end_ns


def _around(gone: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the times without these, the earliest first."""
    stays, begin_ns = [], 0
    for begin, end in sorted(gone):
        stays.append((begin_ns, begin))
        begin_ns = max(begin_ns, end)
    return [(begin, end) for begin, end in [*stays, (begin_ns, END_NS)] if begin < end]


def _naming(names: Collection[str]) -> list[Recording]:
    """Return the recordings whose reason or events have one of the names as a word."""
    might = Q(pk__in=[])
    for name in names:
        might |= Q(reason__contains=name)
        for ascii_only in (True, False):  # JSON as SQLite stores it, and as PostgreSQL stores it
            might |= Q(happened__contains=json.dumps(name, ensure_ascii=ascii_only)[1:-1])
    found = Recording.objects.exclude(place=Place.GONE).annotate(happened=Cast("events", TextField()))
    return [
        one
        for one in found.filter(might)
        if _word_of(names, one.reason) or any(_names_one(event, names) for event in one.events)
    ]


def _names_one(event: dict[str, Any], names: Collection[str]) -> bool:
    return any(_word_of(names, str(event.get(field, ""))) for field in ("by", "text"))


def _word_of(names: Collection[str], text: str) -> bool:
    return bool(names) and re.search(rf"(?<!\w)(?:{'|'.join(map(re.escape, names))})(?!\w)", text) is not None
