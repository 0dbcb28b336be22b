"""Control sessions in the admin: read-only, in the style of the audit log's lists."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from typing import Any
from zoneinfo import ZoneInfo

from django.contrib import admin
from django.db.models import Q, QuerySet
from django.http import HttpRequest, HttpResponseBase
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from fleet.accounts.requests import person_of
from fleet.audit.admin import Line, ListAdmin, count_of
from fleet.audit.reading import exports
from fleet.audit.reading.addresses import beside, by_day, number, session_url_of
from fleet.audit.reading.forms import FilterForm
from fleet.audit.reading.listing import CONSOLE, COUNTED, PAGE
from fleet.base import zones
from fleet.base.durations import duration_text
from fleet.base.formats.sentences import in_words
from robots.registry.models import Robot
from teleop.control.selectors import end_notes
from teleop.models import ControlSession, EndReason

GOES_ON = "goes_on"  # value of the filter for sessions that have not ended
_COLUMNS = [
    *("control_session", "robot", "robot_id", "person", "person_id", "fence"),
    *("began_utc", "began_local", "ended_utc", "ended_local", "ended_by"),
]
_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_MICROSECOND = datetime.timedelta(microseconds=1)

Sessions = QuerySet[ControlSession]


@admin.register(ControlSession)
class ControlSessionAdmin(ListAdmin):
    """All control sessions, newest first. The start times of sessions divide the list into pages."""

    outcomes_are = gettext_lazy("Ended by")

    def form_for(self, request: HttpRequest) -> FilterForm:
        form = FilterForm(
            request.GET, kinds=[], without=["q", "kind", "session"], outcomes_are=self.outcomes_are
        )
        form.offer("robot", [(str(robot.pk), str(robot)) for robot in Robot.objects.order_by("name")])
        form.offer("outcome", [(GOES_ON, _("goes on")), *EndReason.choices])
        return form

    def found(self, request: HttpRequest, form: FilterForm) -> dict[str, Any]:
        """Return one page and the links to its neighbours."""
        sessions = _filtered(form)
        of_the_days = sessions.filter(_days(form))
        before, after = number(request, "before"), number(request, "after")
        if after is not None:
            rows = _first_of(of_the_days.filter(started_at__gt=_time(after)), PAGE, newest=False)[::-1]
        elif before is not None:
            rows = _first_of(of_the_days.filter(started_at__lt=_time(before)), PAGE)
        else:
            rows = _first_of(of_the_days, PAGE)
        notes = end_notes([row.pk for row in rows])
        return {
            "days": by_day(
                request,
                [(zones.day_of(row.started_at), _line(row, in_words(notes.get(row.pk, "")))) for row in rows],
            ),
            "count": count_of(of_the_days.order_by()[: COUNTED + 1].count())
            if before is None and after is None
            else "",
            **beside(
                request,
                [_key(row.started_at) for row in rows],
                newer=bool(rows) and of_the_days.filter(started_at__gt=rows[0].started_at).exists(),
                older=bool(rows) and of_the_days.filter(started_at__lt=rows[-1].started_at).exists(),
                day_before=_day_beside(sessions, form.cleaned_data["since"], later=False),
                day_after=_day_beside(sessions, form.cleaned_data["until"], later=True),
            ),
        }

    def exported(self, request: HttpRequest, form: FilterForm, format_: exports.Format) -> HttpResponseBase:
        """Export every session that matches the filters."""
        chunks = _chunks(_filtered(form).filter(_days(form)), zones.viewers())
        content = exports.table(_COLUMNS, chunks, format_)
        return exports.response(content, form.wanted(), actor=person_of(request), name="control-sessions")


def _chunks(sessions: Sessions, zone: ZoneInfo) -> Iterator[list[exports.Facts]]:
    """Yield the sessions in chunks, newest first: there may be many."""
    found = _first_of(sessions, exports.CHUNK)
    while found:
        yield [_facts(session, zone) for session in found]
        found = _first_of(sessions.filter(started_at__lt=found[-1].started_at), exports.CHUNK)


def _first_of(sessions: Sessions, count: int, *, newest: bool = True) -> list[ControlSession]:
    """Return `count` of the newest or oldest sessions, and all that began at the same moment as the last of them."""
    sign = "-" if newest else ""
    found = list(sessions.order_by(f"{sign}started_at", f"{sign}pk")[: count + 1])
    if len(found) <= count:
        return found
    *found, beyond = found
    if beyond.started_at != found[-1].started_at:
        return found
    same = sessions.filter(started_at=beyond.started_at).order_by(f"{sign}pk")
    return [row for row in found if row.started_at != beyond.started_at] + list(same)


def _facts(session: ControlSession, zone: ZoneInfo) -> exports.Facts:
    ended = session.ended_at
    facts = (
        *(str(session.pk), session.robot.name, str(session.robot_id)),
        *(session.user.display_name, str(session.user_id), session.fence),
        *(session.started_at.isoformat(), exports.local(session.started_at, zone)),
        *((ended.isoformat(), exports.local(ended, zone)) if ended else (None, None)),
        session.end_reason,
    )
    return dict(zip(_COLUMNS, facts, strict=True))


def _filtered(form: FilterForm) -> Sessions:
    wanted = form.wanted()
    which = Q()
    if wanted.robot:
        which &= Q(robot=wanted.robot)
    if wanted.outcome:
        which &= Q(ended_at=None) if wanted.outcome == GOES_ON else Q(end_reason=wanted.outcome)
    if wanted.person:
        which &= Q(pk=None) if wanted.person == CONSOLE else Q(user=wanted.person)
    return ControlSession.objects.select_related("robot", "user").filter(which)


def _days(form: FilterForm) -> Q:
    since, until = form.cleaned_data["since"], form.cleaned_data["until"]
    which = Q()
    if since:
        which &= Q(started_at__gte=_first(since))
    if until:
        which &= Q(started_at__lt=_end(until))
    return which


def _day_beside(sessions: Sessions, edge: datetime.date | None, *, later: bool) -> datetime.date | None:
    """Return the next day after, or before, `edge` on which a session began."""
    if edge is None:
        return None
    if later:
        session = sessions.filter(started_at__gte=_end(edge)).order_by("started_at").first()
    else:
        session = sessions.filter(started_at__lt=_first(edge)).order_by("-started_at").first()
    return zones.day_of(session.started_at) if session else None


def _line(session: ControlSession, note: str) -> Line:
    lasted = (session.ended_at or session.started_at) - session.started_at
    return Line(
        url=session_url_of(session.pk),
        at=session.started_at,
        robot=session.robot.name,
        who=session.user.display_name,
        what=_("had control for %s") % duration_text(lasted.total_seconds())
        if session.ended_at
        else _("has control"),
        subject="",
        expired=False,
        outcome=session.get_end_reason_display(),
        facts=[note] if note else [],
        session_url="",
    )


def _first(day: datetime.date) -> datetime.datetime:
    return zones.start_of(day, zones.viewers())


def _end(day: datetime.date) -> datetime.datetime:
    return zones.end_of(day, zones.viewers())


def _key(moment: datetime.datetime) -> int:
    """Return microseconds since 1970."""
    return (moment - _EPOCH) // _MICROSECOND


def _time(key: int) -> datetime.datetime:
    return _EPOCH + min(key, _key(datetime.datetime.max.replace(tzinfo=datetime.UTC))) * _MICROSECOND
