"""Control sessions and the audit log, as on the pages: staff read all, other people only their part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import date
from typing import Annotated, Any, Literal
from uuid import UUID

from django.core.exceptions import PermissionDenied
from django.db.models import Q
from django.http import HttpResponseBase
from django.shortcuts import get_object_or_404
from msgspec import Meta, Struct

from fleet.accounts.models import User
from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.models import Actor, Record
from fleet.audit.reading import exports, wording
from fleet.audit.reading.listing import CONSOLE, Row, Selection, Wanted, row_of, rows_of
from fleet.audit.reading.search import words_of
from robots.registry.models import Robot
from robots.shared.wire import Refusal
from teleop.api.v1.framework.cursors import decoded, encoded, page_by_time
from teleop.api.v1.framework.operation import ApiView, Entry, entry_of, reads
from teleop.api.v1.framework.parameters import Cursor, Limit, Moment, Order, Time, utc
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.control.selectors import end_notes
from teleop.models import ControlSession
from teleop.reports.own_data import records_visible_to
from teleop.reports.session_report import report_of, session_visible_to, sessions_visible_to

ME = "me"
NONE = "none"  # as value of `robot`: records without robot

_NAME_A_ROBOT = Refusal(
    "robot_needed", "This token is for some robots only: name one of them as `robot`.", "wire"
)
PersonName = Annotated[str, Meta(max_length=150, description="“me”, or a user name.")]
RobotName = Annotated[str, Meta(max_length=100)]


class SessionEntry(Struct, frozen=True):
    """A control session: from taking control to its end."""

    id: UUID
    robot: str
    person: str  # name
    yours: bool
    program: str | None  # name of the token; null: a person in a browser
    fence: int
    started_at: Time
    ended_at: Time | None  # null: it goes on
    end_reason: str
    note: str  # about its end


class SessionList(Struct, frozen=True):
    """Control sessions, newest first unless `order` says otherwise.

    `next` is the cursor of the next page; null: this is the last.
    """

    sessions: list[SessionEntry]
    next: str | None


class SessionFigures(Struct, frozen=True):
    """Figures of a control session; of one without end, until now."""

    lasted_s: float
    driven: str  # h:mm:ss
    distance_m: float
    stops: int
    interventions: int  # of the gate
    complete: bool  # the distance of each drive is known


class SessionEvent(Struct, frozen=True):
    """A record of the session, in words."""

    number: int
    at: Time
    what: str
    subject: str
    facts: list[str]
    expired: bool  # its words are no longer kept


class SessionDetail(SessionEntry, frozen=True):
    """A control session with what happened in it, oldest first."""

    figures: SessionFigures
    events: list[SessionEvent]
    truncated: bool  # there are older events


class SessionsAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """Filters of control sessions."""

    robot: RobotName | None = None
    person: PersonName | None = None
    from_: Moment | None = None
    to: Moment | None = None
    state: Literal["open", "ended"] | None = None
    order: Order = "newest"
    cursor: Cursor | None = None
    limit: Limit = 50


class Named(Struct, frozen=True):
    """A robot or a person as the log knows it: the name may be from that time."""

    id: str
    name: str


class AuditOutcome(Struct, frozen=True):
    """The record of a request’s outcome."""

    number: int
    at: Time
    kind: str
    outcome: str
    details: dict[str, Any]


class AuditEntry(Struct, frozen=True):
    """A record of the log, and that of its outcome."""

    number: int
    at: Time
    kind: str
    what: str  # the kind in words
    robot: Named | None
    person: Named | None  # null: the console itself
    really_by: Named | None  # who acted as this person
    session: UUID | None
    fence: int | None
    outcome: str
    details: dict[str, Any]
    expired: bool  # words of it are no longer kept
    ended: AuditOutcome | None


class AuditList(Struct, frozen=True):
    """Records, newest first unless `order` says otherwise.

    `next` is the cursor of the next page; null: this is the last.
    """

    records: list[AuditEntry]
    next: str | None


class RecordsAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Filters of records."""

    robot: Annotated[str, Meta(max_length=100, description="“none”: records without robot.")] | None = None
    person: (
        Annotated[
            str,
            Meta(max_length=150, description="“me”, “console”, a user name, or an identifier of the log."),
        ]
        | None
    ) = None
    kind: Annotated[str, Meta(max_length=100, description="Such as `speech.start`.")] = ""
    outcome: Annotated[str, Meta(max_length=200)] = ""
    session: UUID | None = None
    since: Annotated[date, Meta(description="First day, UTC.")] | None = None
    until: Annotated[date, Meta(description="Last day, UTC.")] | None = None
    q: Annotated[str, Meta(max_length=200, description="Words that were said.")] = ""


class AuditAsked(RecordsAsked, frozen=True, forbid_unknown_fields=True):
    """Filters and page of records."""

    order: Order = "newest"
    cursor: Cursor | None = None
    limit: Limit = 50


class ExportAsked(RecordsAsked, frozen=True, forbid_unknown_fields=True):
    """Filters of records, and the format of the file."""

    format: Literal["jsonl", "csv"] = "jsonl"


class RecordsBase(ApiView):
    tag = "records"

    def reads_of(self, robot_id: UUID | None) -> bool:
        """Return whether the token may be used for this robot.

        A token that is bound to robots may not be used for records without robot.
        """
        token = self.token
        return token is None or not token.robots or (robot_id is not None and token.serves(robot_id))

    def wanted(self, asked: RecordsAsked) -> Wanted:
        """Return the filters of the request, limited to records that the person may read.

        Raises `Problem`.
        """
        wanted = records_visible_to(
            self.person,
            Wanted(
                words=words_of(asked.q),
                since=asked.since,
                until=asked.until,
                robot=self._robot(asked.robot),
                person=_actor(asked.person, self.person),
                kind=asked.kind,
                outcome=asked.outcome,
                session=asked.session,
            ),
        )
        if wanted is None:
            raise Problem(NOT_FOUND)
        return wanted

    def entry(
        self, kind: type[Entry], session: ControlSession, notes: Mapping[UUID, object], /, **others: Any
    ) -> Entry:
        """Return a session as it is shown to this person."""
        return entry_of(
            kind,
            session,
            robot=session.robot.slug,
            person=session.user.display_name,
            yours=session.user_id == self.person.pk,
            note=str(notes.get(session.pk, "")),
            **others,
        )

    def _robot(self, slug: str | None) -> UUID | None:
        """Return the robot of the filter; None: all robots. Raises `Problem`.

        People may also name a robot that they may no longer see: they can still read their own records of it.
        """
        token = self.token
        if slug is None:
            if token is None or not token.robots:
                return None
            if len(token.robots) > 1:
                raise Problem(_NAME_A_ROBOT)
            return UUID(token.robots[0])
        found = (
            NO_ROBOT if slug == NONE else Robot.objects.filter(slug=slug).values_list("pk", flat=True).first()
        )
        if found is None or not self.reads_of(None if found == NO_ROBOT else found):
            raise Problem(NOT_FOUND)
        if found != NO_ROBOT and not self.person.is_staff:
            theirs = Record.objects.filter(robot_id=found, actor=str(self.person.pk))
            if slug not in [robot.slug for robot in self.robots()] and not theirs.exists():
                raise Problem(NOT_FOUND)
        return found


class SessionsView(RecordsBase):
    @reads("sessions_list", "List control sessions")
    def get(self, query: SessionsAsked) -> SessionList:
        """Your own, and those of robots that you supervise; staff read all. `from` and `to`: when they began."""
        found = sessions_visible_to(self.person)
        token = self.token
        if token is not None and token.robots:
            found = found.filter(robot__in=token.robots)
        if query.robot is not None:
            if not found.filter(robot__slug=query.robot).exists():
                self.robot(query.robot)
            found = found.filter(robot__slug=query.robot)
        if query.person is not None:
            found = found.filter(
                Q(user=self.person) if query.person == ME else Q(user__username=query.person)
            )
        if query.from_ is not None:
            found = found.filter(started_at__gte=utc(query.from_))
        if query.to is not None:
            found = found.filter(started_at__lt=utc(query.to))
        if query.state is not None:
            found = found.filter(ended_at__isnull=query.state == "open")
        oldest = query.order == "oldest"
        rows, following = page_by_time(found, "started_at", query.cursor, query.limit, oldest_first=oldest)
        notes = end_notes([one.pk for one in rows])
        return SessionList([self.entry(SessionEntry, one, notes) for one in rows], following)


class SessionView(RecordsBase):
    @reads("sessions_read", "Read a control session")
    def get(self, session_id: UUID) -> SessionDetail:
        """Figures, and what happened in it."""
        session = session_visible_to(self.person, session_id)
        if session is None or not self.reads_of(session.robot_id):
            raise Problem(NOT_FOUND)
        report = report_of(session)
        return self.entry(
            SessionDetail,
            session,
            end_notes([session.pk]),
            figures=entry_of(SessionFigures, report.figures, lasted_s=report.lasted_s),
            events=[entry_of(SessionEvent, one) for one in report.entries],
            truncated=report.truncated,
        )


class AuditView(RecordsBase):
    @reads("audit_list", "Read the log")
    def get(self, query: AuditAsked) -> AuditList:
        """Your own records; staff read all. Each request with its outcome."""
        edge = min(decoded(query.cursor, int)[0], 2**62) if query.cursor else None
        selection = Selection(self.wanted(query))
        if query.order == "oldest":
            numbers = selection.numbers(query.limit + 1, after=edge or 0)[::-1]
        else:
            numbers = selection.numbers(query.limit + 1, before=edge)
        shown = numbers[: query.limit]
        following = encoded(shown[-1]) if len(numbers) > query.limit else None
        return AuditList([_audit(row) for row in rows_of(shown)], following)


class RecordView(RecordsBase):
    @reads("audit_read", "Read a record")
    def get(self, number: int) -> AuditEntry:
        """The record and its outcome. If the number is that of an outcome: its request."""
        row = row_of(get_object_or_404(Record, pk=min(number, 2**62)))
        mine = str(self.person.pk) in (row.record.actor_id, row.record.real_actor_id)
        if not (mine or self.person.is_staff) or not self.reads_of(row.record.robot_id):
            raise Problem(NOT_FOUND)
        return _audit(row)


class ExportView(RecordsBase):
    def concerned(self, query: ExportAsked, **_asked: Any) -> Iterable[Robot]:
        return Robot.objects.filter(pk__in=[self._robot(query.robot)])

    @reads("audit_export", "Export the log", content_type="application/jsonl text/csv")
    def post(self, query: ExportAsked) -> HttpResponseBase:
        """For staff. Streams all records that match, and is itself recorded."""
        if not self.person.is_staff:
            raise PermissionDenied("Only staff export the log. Your own data are on the page Your data.")
        wanted = self.wanted(query)
        content = exports.records(Selection(wanted), exports.Format(query.format))
        return exports.response(content, wanted, actor=self.person, name="everything")


def _actor(name: str | None, person: User) -> str:
    """Return an actor’s id in the log; blank: anybody. Raises `Problem`: nobody has this name."""
    if name is None:
        return ""
    if name == ME:
        return str(person.pk)
    if name == CONSOLE:
        return name
    found = User.objects.filter(username=name).values_list("pk", flat=True).first()
    if found is None and not Actor.objects.filter(pk=name).exists():
        raise Problem(NOT_FOUND)
    return str(found or name)


def _audit(row: Row) -> AuditEntry:
    record, end = row.record, row.end
    really_by = record.real_actor
    return entry_of(
        AuditEntry,
        record,
        number=record.pk,
        what=wording.label(record.kind),
        robot=Named(str(record.robot_id), record.robot_name) if record.robot_id else None,
        person=Named(record.actor_id, record.actor_name) if record.actor_id else None,
        really_by=Named(really_by.pk, really_by.name) if really_by else None,
        session=record.session_id,
        outcome=row.outcome,
        expired=wording.expired(record),
        ended=entry_of(AuditOutcome, end, number=end.pk) if end else None,
    )
