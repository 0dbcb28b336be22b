"""Who sees which recordings, and which part of each. Every list, page, download and export asks here.

A recording may show the sessions of several people. Staff, supervisors of the robot or the course, and those with whom
it is shared see all of it. Its owner does so, too, while it shows nobody else's session. Everybody else who had control
in it sees only the time of their own sessions.
"""

from __future__ import annotations

from datetime import datetime
from itertools import chain
from typing import NamedTuple

from django.db.models import Exists, F, OuterRef, Q, QuerySet
from django.db.models.functions import Coalesce, Now
from django.utils import timezone

from fleet.accounts.models import User
from fleet.bookings.models import Booking
from robots.access.models import Course
from robots.access.selectors import lab_date
from robots.access.who_sees import Reader, reader_of
from robots.recordings.models import Place, Recording
from teleop.models import ControlSession, RecordingShare


class Part(NamedTuple):
    """A time of a recording."""

    begins_at: datetime
    ends_at: datetime


class Sight(NamedTuple):
    """What a person may see of a recording. `parts`: in order, without gaps of zero length; whole: one part."""

    recording: Recording
    whole: bool
    parts: list[Part]
    may_change: bool  # keep, share and delete it

    def part_at(self, moment: datetime) -> Part | None:
        """Return the part with this moment; None: the person must not see it."""
        return next((part for part in self.parts if part.begins_at <= moment <= part.ends_at), None)


def recordings_of(user: User, reader: Reader | None = None) -> QuerySet[Recording]:
    """Return the recordings of which a person sees at least a part, the newest first. Deleted ones are not there."""
    there = Recording.objects.exclude(place=Place.GONE)
    reader = reader or reader_of(user)
    if not user.is_active:
        return there.none()
    if reader.robots is None:
        return there
    managed = Course.objects.filter(pk__in=reader.courses)
    own = ControlSession.objects.filter(user=user)
    return there.filter(
        Q(person=user)
        | Q(robot__in=reader.robots)
        | Q(course__in=managed.values("slug"))
        | Q(booking__in=Booking.objects.filter(course__in=reader.courses).values("pk"))
        | Q(pk__in=_shared_with(user).values("recording"))
        | Exists(_within(own))
    )


def sight_of(user: User, recording: Recording, reader: Reader | None = None) -> Sight | None:
    """Return what a person sees of a recording; None: nothing."""
    reader = reader or reader_of(user)
    whole = [Part(recording.begins_at, recording.ends_at)]
    if not user.is_active or recording.place == Place.GONE:
        return None
    if _by_role(reader, recording):
        return Sight(recording, True, whole, True)
    mine = recording.person_id == user.pk
    sessions = sessions_in(recording)
    if mine and all(session.user_id == user.pk for session in sessions):
        return Sight(recording, True, whole, True)
    if _shared_with(user).filter(recording=recording.pk).exists():
        return Sight(recording, True, whole, mine)
    parts = [_clipped(session, recording) for session in sessions if session.user_id == user.pk]
    return Sight(recording, False, parts, False) if parts else None


def sessions_in(recording: Recording) -> list[ControlSession]:
    """Return the control sessions of the robot that a recording shows, the earliest first."""
    sessions = ControlSession.objects.filter(robot=recording.robot_id, started_at__lt=recording.ends_at)
    over = Q(ended_at=None) | Q(ended_at__gt=recording.begins_at)
    return list(sessions.filter(over).select_related("user").order_by("started_at"))


def recordings_of_session(session: ControlSession) -> QuerySet[Recording]:
    """Return the recordings that show a part of a session, the earliest first."""
    return (
        Recording.objects.exclude(place=Place.GONE)
        .filter(
            robot=session.robot_id,
            begins_at__lt=session.ended_at or timezone.now(),
            ends_at__gt=session.started_at,
        )
        .order_by("begins_at")
    )


def _by_role(reader: Reader, recording: Recording) -> bool:
    """Return whether the person sees all of it as staff, or as supervisor of the robot or the course."""
    if reader.sees_past(recording.robot_id):
        return True
    slugs = chain(
        [recording.course] if recording.course else [],
        Booking.objects.filter(pk=recording.booking, course__isnull=False).values_list(
            "course__slug", flat=True
        )
        if recording.booking
        else [],
    )
    return (
        Course.objects.filter(pk__in=reader.courses, slug__in=list(slugs)).exists()
        if reader.courses
        else False
    )


def _shared_with(user: User) -> QuerySet[RecordingShare]:
    """Return what is shared with a person, or with a course in which the person is now."""
    today = lab_date()
    enrolled = Course.objects.filter(
        enrolments__person=user, archived=False, starts_on__lte=today, ends_on__gte=today
    )
    return RecordingShare.objects.filter(Q(person=user) | Q(course__in=enrolled))


def _within(sessions: QuerySet[ControlSession]) -> QuerySet[ControlSession]:
    return (
        sessions.filter(robot=OuterRef("robot"), started_at__lt=OuterRef("ends_at"))
        .alias(over=Coalesce(F("ended_at"), Now()))
        .filter(over__gt=OuterRef("begins_at"))
    )


def _clipped(session: ControlSession, recording: Recording) -> Part:
    ended_at = session.ended_at or recording.ends_at
    return Part(max(session.started_at, recording.begins_at), min(ended_at, recording.ends_at))
