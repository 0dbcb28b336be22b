"""Recordings of a person who is erased: theirs are deleted; others lose their names and the time of their sessions."""

from __future__ import annotations

from typing import Any

from django.db.models import Q
from django.dispatch import receiver
from django.utils import timezone

from fleet.accounts.models import ERASED, User
from fleet.accounts.services import erased
from robots.recordings.models import Place, Recording
from teleop.models import ControlSession, RecordingShare
from teleop.recordings.listing import has
from teleop.recordings.selectors import Part, Sight, recordings_about, sessions_in, without_erased


@receiver(erased)
def _forget(*, user: User, **_options: Any) -> None:
    """Delete what shows nobody else. In the rest `selectors` hides the sessions; names leave the rows here."""
    RecordingShare.objects.filter(person=user).delete()
    names = {name for name in (user.username, user.full_name, user.display_name) if name}
    for recording in recordings_about(user):
        if _shows_others(recording, user):
            _take_out(recording, user, names)
        else:
            Recording.objects.filter(pk=recording.pk).update(
                place=Place.GONE, deleted_at=timezone.now(), person=None, reason="", events=[]
            )
    named = Q()
    for name in names:
        named |= has("events", "by", name)
    for recording in Recording.objects.filter(named):
        _take_out(recording, user, names)


def _shows_others(recording: Recording, user: User) -> bool:
    """Return whether it shows somebody else's session, or, if another person owns it, any time without one."""
    if recording.person_id == user.pk:
        return any(not session.user.username.startswith(ERASED) for session in sessions_in(recording))
    whole = [Part(recording.begins_at, recording.ends_at)]
    return without_erased([Sight(recording, True, whole, False)]) != [None]


def _take_out(recording: Recording, user: User, names: set[str]) -> None:
    own = recording.person_id == user.pk
    sessions = [one for one in sessions_in(recording) if one.user_id == user.pk]
    recording.events = [
        event | {"by": "", "text": ""} if event.get("by") in names else event
        for event in recording.events
        if not any(_covers(one, event["at"]) for one in sessions)
    ]
    if own:
        recording.person, recording.reason = None, ""
    recording.save(update_fields=["events", "person", "reason"])


def _covers(session: ControlSession, at_s: float) -> bool:
    ended_s = session.ended_at.timestamp() if session.ended_at else float("inf")
    return session.started_at.timestamp() <= at_s <= ended_s
