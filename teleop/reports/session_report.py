"""The report of a control session: timeline, path and figures. Read from the audit log."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import islice
from typing import Any
from uuid import UUID

from django.db.models import Case, F, Q, QuerySet, When
from django.utils import timezone
from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.reading import wording
from fleet.audit.reading.listing import Row, Selection, Wanted, rows_of
from fleet.base.durations import duration_text
from fleet.bookings.models import Booking
from robots.access.who_sees import Reader, reader_of
from teleop.models import ControlSession
from teleop.reports.path_plot import DrivePath, MapImage, Plot, plot_drives
from teleop.reports.session_maps import maps_of

MOST_ENTRIES = 1000  # of a timeline; older ones are not shown
_CHUNK = 250
LINE_BEFORE = timedelta(hours=1)  # the wait for control that is shown with a session
_MOST_ROBOT_EVENTS = 50  # of each group of `_ROBOT_EVENTS`
# Events of the robot that do not depend on control and may name no control session.
_ROBOT_EVENTS = (("fault", "stop.press", "stop.latch", "stop.moves"), ("health.worse", "health.better"))


class TimelineEntry(Struct, frozen=True):
    """One line of the timeline."""

    number: int  # of its record
    at: datetime
    at_s: float  # since the session began
    group: str  # first part of the record's kind: control, drive, speech
    what: str
    subject: str
    facts: list[str]  # the actor unless it is the holder; outcome; figures
    expired: bool


class Figures(Struct, frozen=True):
    """Figures of a session."""

    lasted: str  # h:mm:ss
    driven: str
    distance_m: float
    stops: int
    interventions: int
    complete: bool  # the distance of each drive is known


class BookingLife(Struct, frozen=True):
    """The booking in which a session took place, and what came before the session: booking, moves, the line."""

    id: UUID | None  # None: control was taken in free time
    starts_at: datetime | None
    ends_at: datetime | None
    person: str  # the person of the booking; "": the session's person
    purpose: str
    entries: list[TimelineEntry]


class SessionReport(Struct, frozen=True):
    """The content of the page."""

    lasted_s: float
    entries: list[TimelineEntry]
    truncated: bool  # there are older entries
    figures: Figures
    plot: Plot | None
    path_expired: bool  # of one drive at least


def session_visible_to(user: User, session_id: UUID) -> ControlSession | None:
    """Return the control session if `user` reads this past (`robots.access.who_sees`); else None."""
    session = ControlSession.objects.select_related("robot", "user").filter(pk=session_id).first()
    if session is None:
        return None
    return session if reader_of(user).sees_past(session.robot_id, [session.user_id]) else None


def sessions_visible_to(user: User) -> QuerySet[ControlSession]:
    """Return the control sessions that `session_visible_to` would return to this person."""
    sessions, robots = ControlSession.objects.select_related("robot", "user"), reader_of(user).robots
    return sessions if robots is None else sessions.filter(Q(user=user) | Q(robot__in=robots))


def report_of(session: ControlSession) -> SessionReport:
    """Build the report from the audit log."""
    newest = Selection(Wanted(session=session.pk)).chunks(_CHUNK)
    found = list(islice((row for chunk in newest for row in chunk), MOST_ENTRIES + 1))
    rows = _with_robot_events(found[:MOST_ENTRIES][::-1], session)
    drives = [row for row in rows if row.record.kind == "drive.start"]
    lasted_s = _since(session, session.ended_at or timezone.now())
    return SessionReport(
        lasted_s=lasted_s,
        entries=[_entry(row, session) for row in rows],
        truncated=len(found) > MOST_ENTRIES,
        figures=_figures(rows, drives, lasted_s),
        plot=_plot(rows, drives, session),
        path_expired=any(row.end and wording.expired(row.end) for row in drives),
    )


def _with_robot_events(rows: list[Row], session: ControlSession) -> list[Row]:
    """Add the robot's events during the session that name no session. Return all rows, oldest first."""
    if not rows:
        return rows
    meanwhile = Record.objects.filter(
        robot_id=session.robot_id,
        session_id=None,
        of=None,
        pk__gt=rows[0].number,
        pk__lt=rows[-1].number,
    ).select_related("actor", "real_actor", "content")
    robot_events = [
        Row(record.pk, record, None)
        for kinds in _ROBOT_EVENTS
        for record in meanwhile.filter(kind__in=kinds).order_by("-pk")[:_MOST_ROBOT_EVENTS]
    ]
    return sorted([*rows, *robot_events], key=lambda row: row.number)


# --- booking and line -----------------------------------------------------------------------------


def booking_life(session: ControlSession, reader: Reader) -> BookingLife | None:
    """Return the booking of a session, with its records and the records of its person's wait in line.

    Of another person's booking, only those who read the past of others get the records, the person and the purpose.
    """
    ended = session.ended_at or timezone.now()
    slots = Booking.objects.filter(
        robot=session.robot, starts_at__lt=ended, held_until__gt=session.started_at
    )
    slots = slots.exclude(held_until=F("starts_at"))  # without bookings that were cancelled before they began
    # Another person's: taken over in it, or handed over since
    of_another = Case(When(person=session.user, then=0), default=1)
    booking = slots.select_related("person", "course").order_by(of_another, "starts_at").first()
    of_robot = Record.objects.filter(robot_id=session.robot_id, of=None)
    line = of_robot.filter(
        Q(actor_id=str(session.user_id)) | Q(parameters__to=str(session.user_id)),
        kind__in=("control.ask", "control.offer"),
        at__range=(session.started_at - LINE_BEFORE, session.started_at),
    )
    found = [*line.order_by("-pk")[:_MOST_ROBOT_EVENTS]]
    shown = booking is not None and reader.sees_past(booking.robot_id, [booking.person_id], booking.course_id)
    if booking is not None and shown:
        of_booking = of_robot.filter(kind__startswith="booking.", parameters__booking=str(booking.pk))
        found += of_booking.order_by("-pk")[:_MOST_ROBOT_EVENTS]
    if not found and booking is None:
        return None
    entries = [_entry(row, session) for row in rows_of(sorted(record.pk for record in found))]
    if booking is None:
        return BookingLife(None, None, None, "", "", entries)
    person = booking.lesson_of or (booking.person.display_name if shown else _("another person"))
    return BookingLife(
        booking.pk,
        booking.starts_at,
        booking.held_until,
        "" if booking.person_id == session.user_id else person,
        booking.purpose if shown else "",
        entries,
    )


# --- timeline -------------------------------------------------------------------------------------


def _entry(row: Row, session: ControlSession) -> TimelineEntry:
    record = row.record
    records = [record, row.end] if row.end else [record]
    who = "" if record.actor_id == str(session.user_id) else wording.who(record)
    what, outcome = wording.label(record.kind), wording.outcome(row.outcome)
    return TimelineEntry(
        number=record.pk,
        at=record.at,
        at_s=_since(session, record.at),
        group=record.kind.partition(".")[0],
        what=what,
        subject=wording.subject(record),
        facts=[words for words in (who, outcome, *wording.facts(records)) if words not in ("", what)],
        expired=any(wording.expired(one) for one in records),
    )


def _since(session: ControlSession, at: datetime) -> float:
    return round(max((at - session.started_at).total_seconds(), 0.0), 2)


# --- figures --------------------------------------------------------------------------------------


def _figures(rows: Sequence[Row], drives: Sequence[Row], lasted_s: float) -> Figures:
    kinds = [row.record.kind for row in rows]
    ends = [row.end for row in drives if row.end]
    return Figures(
        lasted=duration_text(lasted_s),
        driven=duration_text(sum(_driven_s(row) for row in drives)),
        distance_m=sum(end.details.get("distance_m", 0.0) for end in ends),
        stops=sum(row.record.parameters.get("times", 1) for row in rows if row.record.kind == "stop.press"),
        interventions=kinds.count("gate.begin"),
        complete=not any(wording.expired(end) and "distance_m" not in end.parameters for end in ends),
    )


def _driven_s(drive: Row) -> float:
    """Return the seconds of a drive; 0 if unknown: the bridge was killed, or the drive is still running."""
    if drive.end is None:
        return 0.0
    if "duration_s" in drive.end.details:
        return float(drive.end.details["duration_s"])
    # Until November 2026 the duration expired with the path.
    return (drive.end.at - drive.record.at).total_seconds() if wording.expired(drive.end) else 0.0


# --- path -----------------------------------------------------------------------------------------


def _plot(rows: Sequence[Row], drives: Sequence[Row], session: ControlSession) -> Plot | None:
    paths = {
        drive.record.pk: DrivePath(
            begins_s=_since(session, drive.record.at),
            samples=_detail(drive.end, "path") or [],
            frame=_detail(drive.end, "map_to_odom") or _detail(drive.record, "map_to_odom"),
        )
        for drive in drives
    }
    marks = [
        (pose, paths[row.record.of_id].frame)
        for row in rows
        if row.record.kind == "gate.begin"
        and row.record.of_id in paths
        and (pose := _detail(row.record, "pose"))
    ]
    return plot_drives(list(paths.values()), marks, _map_image(session))


def _map_image(session: ControlSession) -> MapImage | None:
    """Return the robot's map at that time."""
    found = maps_of(session).defer("picture").last()
    if found is None:
        return None
    wide_m, high_m = found.width * found.resolution_m, found.height * found.resolution_m
    return MapImage(found.pk, wide_m, high_m, (found.origin_x_m, found.origin_y_m, found.origin_yaw))


def _detail(record: Record | None, name: str) -> Any:
    return None if record is None else record.details.get(name)
