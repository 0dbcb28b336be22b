"""What happened while somebody had control of a robot: a timeline, the path, and figures. Read from the audit log."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from itertools import islice
from typing import Any
from uuid import UUID

from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit import wording
from fleet.audit.listing import Row, Selection, Wanted
from fleet.audit.models import Record
from robots.registry.selectors import supervises
from teleop.models import ControlSession
from teleop.reports.durations import clock
from teleop.reports.path_plot import Ground, Leg, Plot, plotted
from teleop.reports.session_maps import maps_of

MOST_ENTRIES = 1000  # of a timeline: the newest
_CHUNK = 250
_MOST_OF_THE_ROBOT = 50
# What happens to the robot whoever has control, and may name no control session.
_OF_THE_ROBOT = ("fault", "stop.press", "stop.latch")


class Entry(Struct, frozen=True):
    """One line of the timeline."""

    number: int  # of its record
    at: datetime
    at_s: float  # since the session began
    group: str  # what the kind's name begins with: control, drive, speech
    what: str
    subject: str
    told: list[str]  # who, unless that was who had control; what came of it; figures
    expired: bool


class Figures(Struct, frozen=True):
    """What a session came to."""

    lasted: str  # as a clock shows it
    driven: str
    distance_m: float
    stops: int
    interventions: int
    complete: bool  # how far each drive was is known


class SessionReport(Struct, frozen=True):
    """All that the page shows."""

    lasted_s: float
    entries: list[Entry]
    cut_off: bool  # there were more of them
    figures: Figures
    plot: Plot | None
    path_expired: bool  # of one drive at least


def session_seen_by(user: User, session_id: UUID) -> ControlSession | None:
    """The control session, if this is the person concerned, a supervisor of the robot, or staff."""
    session = ControlSession.objects.select_related("robot", "user").filter(pk=session_id).first()
    if session is None:
        return None
    concerned = session.user_id == user.pk or supervises(user, session.robot)
    return session if concerned else None


def report_of(session: ControlSession) -> SessionReport:
    """What the log knows of the session."""
    newest = Selection(Wanted(session=session.pk)).chunks(_CHUNK)
    found = list(islice((row for chunk in newest for row in chunk), MOST_ENTRIES + 1))
    rows = _with_the_robots(found[:MOST_ENTRIES][::-1], session)
    drives = [row for row in rows if row.record.kind == "drive.start"]
    lasted_s = _since(session, session.ended_at or timezone.now())
    return SessionReport(
        lasted_s=lasted_s,
        entries=[_entry(row, session) for row in rows],
        cut_off=len(found) > MOST_ENTRIES,
        figures=_figures(rows, drives, lasted_s),
        plot=_plot(rows, drives, session),
        path_expired=any(row.end and wording.expired(row.end) for row in drives),
    )


def _with_the_robots(rows: list[Row], session: ControlSession) -> list[Row]:
    """Oldest first, with what happened to the robot meanwhile."""
    if not rows:
        return rows
    meanwhile = Record.objects.filter(
        robot_id=session.robot_id,
        kind__in=_OF_THE_ROBOT,
        session_id=None,
        of=None,
        pk__gt=rows[0].number,
        pk__lt=rows[-1].number,
    ).select_related("actor", "real_actor", "content")
    beside = [Row(record.pk, record, None) for record in meanwhile.order_by("-pk")[:_MOST_OF_THE_ROBOT]]
    return sorted([*rows, *beside], key=lambda row: row.number)


# --- timeline -------------------------------------------------------------------------------------


def _entry(row: Row, session: ControlSession) -> Entry:
    record = row.record
    records = [record, row.end] if row.end else [record]
    who = "" if record.actor_id == str(session.user_id) else wording.who(record)
    return Entry(
        number=record.pk,
        at=record.at,
        at_s=_since(session, record.at),
        group=record.kind.partition(".")[0],
        what=wording.label(record.kind),
        subject=wording.subject(record),
        told=[words for words in (who, wording.outcome(row.outcome), *wording.facts(records)) if words],
        expired=any(wording.expired(told) for told in records),
    )


def _since(session: ControlSession, at: datetime) -> float:
    return round(max((at - session.started_at).total_seconds(), 0.0), 2)


# --- figures --------------------------------------------------------------------------------------


def _figures(rows: Sequence[Row], drives: Sequence[Row], lasted_s: float) -> Figures:
    kinds = [row.record.kind for row in rows]
    ends = [row.end for row in drives if row.end]
    return Figures(
        lasted=clock(lasted_s),
        driven=clock(sum(_driven_s(row) for row in drives)),
        distance_m=sum(end.details.get("distance_m", 0.0) for end in ends),
        stops=sum(row.record.parameters.get("times", 1) for row in rows if row.record.kind == "stop.press"),
        interventions=kinds.count("gate.begin"),
        complete=not any(wording.expired(end) and "distance_m" not in end.parameters for end in ends),
    )


def _driven_s(drive: Row) -> float:
    """How long; nothing where nobody knows, because the bridge was killed or the drive goes on."""
    if drive.end is None:
        return 0.0
    if "duration_s" in drive.end.details:
        return float(drive.end.details["duration_s"])
    # Until November 2026 it expired with the path.
    return (drive.end.at - drive.record.at).total_seconds() if wording.expired(drive.end) else 0.0


# --- path -----------------------------------------------------------------------------------------


def _plot(rows: Sequence[Row], drives: Sequence[Row], session: ControlSession) -> Plot | None:
    legs = {
        drive.record.pk: Leg(
            begins_s=_since(session, drive.record.at),
            samples=_told(drive.end, "path") or [],
            frame=_told(drive.end, "map_to_odom") or _told(drive.record, "map_to_odom"),
        )
        for drive in drives
    }
    marks = [
        (pose, legs[row.record.of_id].frame)
        for row in rows
        if row.record.kind == "gate.begin"
        and row.record.of_id in legs
        and (pose := _told(row.record, "pose"))
    ]
    return plotted(list(legs.values()), marks, _ground(session))


def _ground(session: ControlSession) -> Ground | None:
    """The robot's map of then."""
    found = maps_of(session).defer("picture").last()
    if found is None:
        return None
    wide_m, high_m = found.width * found.resolution_m, found.height * found.resolution_m
    return Ground(found.pk, wide_m, high_m, (found.origin_x_m, found.origin_y_m, found.origin_yaw))


def _told(record: Record | None, name: str) -> Any:
    return None if record is None else record.details.get(name)
