"""The rule of who sees which recordings, and which part of each. Every list, page, download and export asks here.

A recording may show the sessions of several people. Staff, supervisors of the robot or the course, and those with whom
it is shared see all of it. Its owner does so, too, while it shows nobody else's session. Everybody else who had control
in it sees only the time of their own sessions. Nobody sees the sessions of people who were erased.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple
from uuid import UUID

from django.db.models import Exists, OuterRef, Q, QuerySet, Subquery
from django.utils import timezone

from fleet.accounts.models import ERASED, User
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
    """The parts of a recording that one may see. `parts`: in order, without gaps of zero length; whole: one part."""

    recording: Recording
    whole: bool
    parts: list[Part]
    may_change: bool  # keep, share and delete it
    tells_owner: bool = True  # who owns it, its reason and its control session

    @property
    def events(self) -> list[dict[str, Any]]:
        """Return the events (`KeptEvent`) in the parts that one may see."""
        times = [(part.begins_at.timestamp(), part.ends_at.timestamp()) for part in self.parts]
        return [
            event
            for event in self.recording.events
            if any(begin <= event["at"] <= end for begin, end in times)
        ]

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
    return there.filter(told_to(user, reader) | _shows(user))


def told_to(user: User, reader: Reader) -> Q:
    """Return the condition that a person sees a recording by more than their sessions in it, so `Sight.tells_owner`."""
    if reader.robots is None:
        return Q()
    managed = Course.objects.filter(pk__in=reader.courses)
    return (
        Q(person=user)
        | Q(robot__in=reader.robots)
        | Q(course__in=managed.values("slug"))
        | Q(booking__in=Booking.objects.filter(course__in=reader.courses).values("pk"))
        | Q(pk__in=_shared_with(user).values("recording"))
    )


def sight_of(user: User, recording: Recording, reader: Reader | None = None) -> Sight | None:
    """Return what a person sees of a recording; None: nothing."""
    return sights_of(user, [recording], reader)[0]


def sights_of(
    user: User, recordings: Sequence[Recording], reader: Reader | None = None
) -> list[Sight | None]:
    """Return what a person sees of each recording. Makes at most five queries, however many they are."""
    reader = reader or reader_of(user)
    there = [one for one in recordings if one.place != Place.GONE] if user.is_active else []
    by_role = {one.pk for one in there if reader.sees_past(one.robot_id)}
    others = [one for one in there if one.pk not in by_role]
    by_role |= of_courses(reader, others)
    shared = (
        set(_shared_with(user).filter(recording__in=others).values_list("recording", flat=True))
        if others
        else ()
    )
    sessions = _sessions(others)

    def sight(recording: Recording) -> Sight | None:
        whole = [Part(recording.begins_at, recording.ends_at)]
        if recording not in there:
            return None
        if recording.pk in by_role:
            return Sight(recording, True, whole, True)
        mine = recording.person_id == user.pk
        shown = [one for one in sessions if parts_of(one, recording)]
        if mine and all(session.user_id == user.pk for session in shown):
            return Sight(recording, True, whole, True)
        if recording.pk in shared:
            return Sight(recording, True, whole, mine)
        parts = [part for one in shown if one.user_id == user.pk for part in parts_of(one, recording)]
        return Sight(recording, False, parts, False, tells_owner=mine) if parts else None

    return without_erased([sight(recording) for recording in recordings])


def own_parts(user: User, recordings: Sequence[Recording]) -> list[list[Part]]:
    """Return which parts of each recording are the person's own data, whatever else the person may see.

    It is the time of their own sessions; all of a recording of theirs that shows nobody's.
    """
    sessions = _sessions(recordings)

    def parts(recording: Recording) -> list[Part]:
        shown = [one for one in sessions if parts_of(one, recording)]
        if recording.person_id == user.pk and all(session.user_id == user.pk for session in shown):
            return [Part(recording.begins_at, recording.ends_at)]
        return [part for one in shown if one.user_id == user.pk for part in parts_of(one, recording)]

    return [parts(recording) for recording in recordings]


def recordings_about(user: User) -> QuerySet[Recording]:
    """Return the recordings that a person owns, or that show a session of theirs, the newest first."""
    return Recording.objects.exclude(place=Place.GONE).filter(Q(person=user) | _shows(user))


def sessions_in(recording: Recording) -> list[ControlSession]:
    """Return the control sessions of the robot that a recording shows, the earliest first."""
    return [one for one in _sessions([recording]) if parts_of(one, recording)]


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


def _sessions(recordings: Sequence[Recording], **chosen: str) -> list[ControlSession]:
    """Return the control sessions that any of these recordings shows, the earliest first. Makes one query."""
    if not recordings:
        return []
    shown = Q()
    for one in recordings:
        over = Q(ended_at=None) | Q(ended_at__gt=one.begins_at)
        shown |= Q(robot=one.robot_id, started_at__lt=one.ends_at) & over
        if one.controls:
            shown |= Q(pk__in={control["session"] for control in one.controls})
    found = ControlSession.objects.filter(shown, **chosen)
    return list(found.select_related("user").order_by("started_at"))


def of_courses(reader: Reader, recordings: Sequence[Recording]) -> set[UUID]:
    """Return which of these the person sees as supervisor of their course."""
    if not recordings or not reader.courses:
        return set()
    slugs = set(Course.objects.filter(pk__in=reader.courses).values_list("slug", flat=True))
    wanted = {one.booking for one in recordings if one.booking}
    bookings = set(
        Booking.objects.filter(pk__in=wanted, course__in=reader.courses).values_list("pk", flat=True)
    )
    return {one.pk for one in recordings if one.course in slugs or one.booking in bookings}


def _shared_with(user: User) -> QuerySet[RecordingShare]:
    """Return what is shared with a person, or with a course in which the person is now."""
    today = lab_date()
    enrolled = Course.objects.filter(
        enrolments__person=user, archived=False, starts_on__lte=today, ends_on__gte=today
    )
    return RecordingShare.objects.filter(Q(person=user) | Q(course__in=enrolled))


def _shows(user: User) -> Q:
    """Return the condition that a recording shows a session of this person.

    One began in it, or had begun before: then it is the last one, because a robot has one at a time. The index finds
    both at once; a comparison of times alone would read all sessions of the robot for each recording.
    """
    earlier = ControlSession.objects.filter(
        robot=OuterRef(OuterRef("robot")), started_at__lt=OuterRef(OuterRef("begins_at"))
    )
    last = ControlSession.objects.filter(
        Q(ended_at=None) | Q(ended_at__gt=OuterRef("begins_at")),
        pk=Subquery(earlier.order_by("-started_at").values("pk")[:1]),
        user=user,
    )
    begun = ControlSession.objects.filter(
        robot=OuterRef("robot"),
        started_at__gte=OuterRef("begins_at"),
        started_at__lt=OuterRef("ends_at"),
        user=user,
    )
    return Q(Exists(begun)) | Q(Exists(last))


def parts_of(session: ControlSession, recording: Recording) -> list[Part]:
    """Return the parts of a recording that show a control session.

    The recorder notes them by the clock of the file. Of a cut file they are not known: there the times of the session
    hold, which are those of the web process.
    """
    if session.robot_id != recording.robot_id:
        return []
    if recording.controls is None:
        times = [(session.started_at, session.ended_at or recording.ends_at)]
    else:
        times = [
            (datetime.fromtimestamp(one["begins"], UTC), datetime.fromtimestamp(one["ends"], UTC))
            for one in recording.controls
            if one["session"] == str(session.pk)
        ]
    parts = [Part(max(begin, recording.begins_at), min(end, recording.ends_at)) for begin, end in times]
    return [part for part in parts if part.begins_at < part.ends_at]


def without_erased(sights: list[Sight | None]) -> list[Sight | None]:
    """Take the sessions of erased people out of what anybody sees."""
    seen = [sight.recording for sight in sights if sight]
    erased = _sessions(seen, user__username__startswith=ERASED)

    def left(sight: Sight | None) -> Sight | None:
        if sight is None or not (
            hidden := [part for one in erased for part in parts_of(one, sight.recording)]
        ):
            return sight
        parts = sight.parts
        for gap in hidden:
            parts = [piece for part in parts for piece in _around(part, gap)]
        return sight._replace(whole=False, parts=parts) if parts else None

    return [left(sight) for sight in sights]


def _around(part: Part, gap: Part) -> list[Part]:
    """Return what is left of a part without a gap."""
    before = Part(part.begins_at, min(part.ends_at, gap.begins_at))
    after = Part(max(part.begins_at, gap.ends_at), part.ends_at)
    return [one for one in (before, after) if one.begins_at < one.ends_at]
