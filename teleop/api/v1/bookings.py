"""Bookings: free slots, the list, one booking and its changes, the waiting list.

The rules are those of the pages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from typing import Annotated, Any, Literal, get_args
from uuid import UUID

from django.db.models import Q, QuerySet
from django.shortcuts import get_object_or_404
from django.urls import reverse
from django.utils import timezone
from msgspec import Meta, Struct
from rest_framework.response import Response

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.base.web.origin import public_url
from fleet.bookings import services
from fleet.bookings.changes import handing
from fleet.bookings.changes.waiting_list import offer_accept, waiting_join, waiting_leave
from fleet.bookings.free_time import ALTERNATIVES, free_on_any
from fleet.bookings.lessons.members import shared_with, teams_of
from fleet.bookings.models import Booking, HandOffer, Waiting
from fleet.bookings.permissions import bookings_managed_by, shows_person
from fleet.bookings.rules import Slot
from fleet.bookings.selectors import OPEN, grace_of, is_recorded, policies_of, stage_of
from fleet.bookings.services import BookingRefused
from fleet.bookings.shared_facts import in_turn
from robots.access.models import Course
from robots.access.selectors import courses_managed_by, robots_bookable_by
from robots.access.who_sees import reader_of
from robots.registry.models import Robot
from robots.shared import wire
from teleop.api.v1.framework.cursors import page_by_time
from teleop.api.v1.framework.operation import ApiView, entry_of, operation, reads
from teleop.api.v1.framework.parameters import Cursor, Limit, Moment, Order, Time, utc
from teleop.api.v1.framework.problems import Problem, ProblemDetails
from teleop.api.v1.framework.versions import IF_MATCH, etag_of, version_seen

ME = "me"  # as value of `person`: the person of the token or session

StageName = Literal[
    "awaiting", "offered", "booked", "due", "in_use", "over", "finished", "no_show", "cancelled"
]
Slug = Annotated[str, Meta(min_length=1, max_length=100)]
Username = Annotated[str, Meta(min_length=1, max_length=150)]
Reason = Annotated[str, Meta(max_length=200)]
_STAGES = get_args(StageName)


class BookingEntry(Struct, frozen=True):
    """A booking. `version` is its ETag, which If-Match names in a change."""

    id: UUID
    version: int
    robot: str
    person: str | None  # name; null: the booking is over, and of another person
    username: str | None  # of your own bookings, and of those that you manage
    yours: bool
    may_change: bool  # you may move, cancel and hand it over now
    course: str | None  # for which it counts; of your own bookings, and of those that you manage
    starts_at: Time
    ends_at: Time
    held_until: Time  # others can book from this time on
    stage: StageName
    purpose: str  # empty where `person` is null
    offer_until: Time | None
    series: UUID | None  # null where `person` is null: its bookings to come name the person
    made_at: Time | None  # null where `person` is null, as `series`
    shared: Literal["", "course", "people"]  # who may drive in it beside its person
    lesson: str | None  # the name of the course that shares it
    shared_with_you: bool
    team: list[str]  # names; of bookings that you share or manage
    turn_min: int | None  # length of a turn; null: no turns
    record: bool  # what the robot senses in it is recorded, by wish, for its course or as a rule of the lab


class BookingList(Struct, frozen=True):
    """Bookings by their start, the latest first unless `order` says otherwise.

    `next` is the cursor of the next page; null: this is the last.
    """

    bookings: list[BookingEntry]
    next: str | None


class SlotEntry(Struct, frozen=True):
    """A slot of a robot."""

    robot: str
    starts_at: Time
    ends_at: Time


class SlotList(Struct, frozen=True):
    """Slots that no rule refuses now, earliest first."""

    slots: list[SlotEntry]


class WaitingEntry(Struct, frozen=True):
    """A slot for which you wait. When it becomes free, you get an offer: a booking in the stage `offered`."""

    number: int
    robot: str
    starts_at: Time
    ends_at: Time
    since: Time
    purpose: str
    course: str | None  # the chosen one
    record: bool  # you wish that what the robot senses in it is recorded


class WaitingList(Struct, frozen=True):
    """The slots for which you wait, earliest first."""

    waiting: list[WaitingEntry]


class BookingProblem(ProblemDetails, frozen=True, kw_only=True):
    """Why a booking is refused: all rules that refuse are in `refusals`. `alternatives` are free."""

    alternatives: list[SlotEntry] = []


class BookingsAsked(Struct, frozen=True, forbid_unknown_fields=True, rename={"from_": "from"}):
    """Filters of bookings."""

    robot: Slug | None = None
    person: (
        Annotated[str, Meta(max_length=150, description="“me”, or a user name: of bookings that you manage.")]
        | None
    ) = None
    course: Annotated[str, Meta(max_length=100, description="Of a course that you manage.")] | None = None
    from_: Moment | None = None
    to: Moment | None = None
    state: (
        Annotated[
            Literal["booked", "awaiting", "offered", "finished", "no_show", "cancelled"],
            Meta(description="As it is stored. `stage` of an answer also depends on the time."),
        ]
        | None
    ) = None
    series: UUID | None = None
    order: Order = "newest"
    cursor: Cursor | None = None
    limit: Limit = 50


class FreeAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Filters of free slots."""

    minutes: Annotated[int, Meta(ge=1, le=10080, description="Length of the slot.")] = 60
    robot: (
        Annotated[str, Meta(max_length=100, description="If left out: any robot that you may see.")] | None
    ) = None
    profile: Annotated[str, Meta(max_length=100, description="A kind of robot.")] | None = None
    after: Moment | None = None
    limit: Annotated[int, Meta(ge=1, le=20, description="The most entries to return.")] = ALTERNATIVES


class CancelAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Why it is cancelled."""

    reason: Annotated[str, Meta(max_length=200, description="Its person reads it.")] = ""


class BookRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A slot to book. `person`: for somebody else; `override`: why against the policy, for managers of the robot.

    `course`: the one for which it counts; without it, the first whose quotas allow it. `lesson_of`: a course that you
    manage, whose people share the slot. `team`: user names of up to three people who share it; they are
    asked first, except those for whom you may book. `turn_min`: they take
    turns of so many minutes. `record`: what the robot senses in the slot is recorded, from the first control on.
    """

    robot: Slug
    starts_at: Moment
    ends_at: Moment
    purpose: Annotated[str, Meta(max_length=120)] = ""
    person: Username | None = None
    override: Reason = ""
    course: Slug | None = None
    lesson_of: Slug | None = None
    team: Annotated[list[Username], Meta(max_length=20)] = []
    turn_min: Annotated[int, Meta(ge=1, le=240)] | None = None
    record: bool = False


class MoveRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """New times. Fields that are left out stay as they are."""

    starts_at: Moment | None = None
    ends_at: Moment | None = None
    override: Reason = ""


class HandBookingRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """The colleague who is asked; null: whoever opens the link first, which the answer has."""

    to: Username | None = None


class HandOfferEntry(Struct, frozen=True):
    """A booking that waits for a colleague's answer. `share`: they are asked to share it. `to`: null for a link."""

    id: UUID
    booking: UUID
    robot: str
    starts_at: Time
    ends_at: Time
    by: str
    to: str | None
    until: Time
    share: bool
    link: str | None  # only in the answer that made it


class HandOfferList(Struct, frozen=True):
    """The bookings that colleagues want to hand you or share with you, that of the earliest slot first."""

    offers: list[HandOfferEntry]


class WaitRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A slot that is taken. The offer gets `purpose`, `course` and `record`."""

    robot: Slug
    starts_at: Moment
    ends_at: Moment
    purpose: Annotated[str, Meta(max_length=120)] = ""
    course: Slug | None = None
    record: bool = False


_change = partial(operation, scope=Scope.BOOK, answer=BookingEntry, refuses=(404, 409))
_change_seen = partial(_change, refuses=(404, 409, 412, 428), parameters=[IF_MATCH])


class BookingsBase(ApiView):
    tag = "bookings"
    seen_by = staticmethod(robots_bookable_by)

    def concerned(self, *_path: Any, **asked: Any) -> list[Robot]:
        if "booking_id" in asked:
            return [self.one(asked["booking_id"]).robot]
        return [self.robot(asked["body"].robot)]

    def seen(self) -> QuerySet[Booking]:
        """Return the bookings of all robots that the person may see, and the token serves."""
        return Booking.objects.filter(robot__in=self.robots()).select_related("robot", "person", "course")

    def one(self, booking_id: UUID) -> Booking:
        """Return one of these bookings. Raises `Http404`."""
        return get_object_or_404(self.seen(), pk=booking_id)

    def entries(self, found: list[Booking]) -> list[BookingEntry]:
        """Return bookings as they are shown to this person."""
        now, person = timezone.now(), self.person
        policies, reader = policies_of({booking.robot for booking in found}), reader_of(person)
        listed = Booking.objects.filter(pk__in=[booking.pk for booking in found])
        managed = set(bookings_managed_by(person, listed).values_list("pk", flat=True))
        shared = set(listed.filter(pk__in=shared_with(person).values("pk")).values_list("pk", flat=True))
        teams = teams_of(found)
        entries = []
        for booking in found:
            stage = stage_of(booking, grace_of(policies[booking.robot_id]), now)
            yours = booking.person_id == person.pk
            knows = yours or booking.pk in managed
            shown = shows_person(reader, booking, stage)
            entries.append(
                entry_of(
                    BookingEntry,
                    booking,
                    robot=booking.robot.slug,
                    person=booking.person.display_name if shown else None,
                    username=booking.person.username if knows else None,
                    yours=yours,
                    may_change=knows and stage in OPEN,
                    course=booking.course.slug if booking.course and knows else None,
                    stage=_STAGES[_STAGES.index(stage.name.lower())],
                    purpose=booking.purpose if shown else "",
                    series=booking.series if shown else None,
                    made_at=booking.made_at if shown else None,
                    lesson=booking.lesson_of or None,
                    shared_with_you=booking.pk in shared,
                    team=teams.get(booking.pk, []) if knows or booking.pk in shared else [],
                    shared=booking.shared,
                    record=is_recorded(booking),
                )
            )
        return entries

    def answer(self, booking_id: UUID, status: int = 200) -> Response:
        """Return a response with the booking and its ETag."""
        booking = Booking.objects.select_related("robot", "person", "course").get(pk=booking_id)
        [entry] = self.entries([booking])
        headers = {"ETag": etag_of(booking.version)}
        if status == 201:
            headers["Location"] = f"/api/v1/bookings/{booking.pk}"
        return Response(wire.to_builtins(entry), status, headers=headers)

    def change(self, booking_id: UUID, step: Callable[..., Any], **facts: Any) -> Response:
        """Change a booking if the client has seen its newest version (If-Match)."""
        version = version_seen(self.request)
        self.one(booking_id)
        step(booking_id=booking_id, version=version, actor=self.person, now=timezone.now(), **facts)
        return self.answer(booking_id)


class BookingsView(BookingsBase):
    @reads("bookings_list", "List bookings")
    def get(self, query: BookingsAsked) -> BookingList:
        """Bookings of all robots that you may see, as in the calendar. `from` and `to`: those that overlap this
        time, also cancelled ones. Of other people's bookings that are over, only supervisors of the robot or the course
        and staff read the person."""
        found = self.seen()
        if query.robot is not None:
            found = found.filter(robot=self.robot(query.robot))
        if query.person == ME:
            found = found.filter(Q(person=self.person) | Q(pk__in=shared_with(self.person).values("pk")))
        elif query.person is not None:
            known = bookings_managed_by(self.person, Booking.objects.all()).values("pk").order_by()
            found = found.filter(Q(person=self.person) | Q(pk__in=known), person__username=query.person)
        if query.course is not None:
            found = found.filter(course=get_object_or_404(courses_managed_by(self.person), slug=query.course))
        if query.from_ is not None:
            found = found.filter(ends_at__gt=utc(query.from_))
        if query.to is not None:
            found = found.filter(starts_at__lt=utc(query.to))
        if query.state is not None:
            found = found.filter(state=query.state)
        if query.series is not None:
            found = found.filter(series=query.series)
        oldest = query.order == "oldest"
        rows, following = page_by_time(found, "starts_at", query.cursor, query.limit, oldest_first=oldest)
        return BookingList(self.entries(rows), following)

    @_change(
        "bookings_make",
        "Book a slot",
        status=201,
        problem=BookingProblem,
        keyed=True,
        examples={
            "An hour": {
                "robot": "tiago-1",
                "starts_at": "2026-03-02T14:00:00Z",
                "ends_at": "2026-03-02T15:00:00Z",
            }
        },
    )
    def post(self, body: BookRequest) -> Response:
        """All rules that refuse stand in `refusals`; if the time is taken, `alternatives` has free slots."""
        robot, slot, now = self.robot(body.robot), _slot(body.starts_at, body.ends_at), timezone.now()
        owner = self.person
        if body.person:
            owner = services.account_named(body.person, self.person, robot, slot.starts_at)
        course, lesson_of = _course(body.course, owner), None
        if body.lesson_of is not None:
            managed = courses_managed_by(self.person).filter(archived=False)
            lesson_of = get_object_or_404(managed, slug=body.lesson_of)
        with _alternatives(), in_turn() as facts:
            booking = handing.booking_make_asking(
                robot=robot,
                person=owner,
                actor=self.person,
                slot=slot,
                purpose=body.purpose,
                override=body.override,
                course=course,
                lesson_of=lesson_of,
                team=services.team_named(body.team, robot, slot.starts_at),
                turn_min=body.turn_min,
                record_it=body.record,
                now=now,
                facts=facts,
            )
        return self.answer(booking.pk, 201)


class FreeView(BookingsBase):
    @reads("bookings_free", "Search free slots")
    def get(self, query: FreeAsked) -> SlotList:
        """From `after` (now, if left out) to the end of the next week, slots that no rule would refuse to you: where
        the quotas of a week are used up, those of the next."""
        now = timezone.now()
        robots = [self.robot(query.robot)] if query.robot is not None else self.robots()
        robots = [robot for robot in robots if robot.enabled]
        if query.profile is not None:
            robots = [robot for robot in robots if robot.profile.slug == query.profile]
        after = max(utc(query.after), now) if query.after else now
        found = free_on_any(robots, self.person, query.minutes, after=after, now=now, most=query.limit)
        return SlotList(_slots(found))


class BookingView(BookingsBase):
    @reads("bookings_read", "Read a booking", answer=BookingEntry)
    def get(self, booking_id: UUID) -> Response:
        """The answer has an ETag: send it as If-Match with a change."""
        return self.answer(self.one(booking_id).pk)

    @_change_seen("bookings_move", "Move, lengthen or shorten a booking", problem=BookingProblem)
    def patch(self, booking_id: UUID, body: MoveRequest) -> Response:
        """For its person, and people who manage it. After the start of a slot, only its end can change."""
        version_seen(self.request)
        old = self.one(booking_id)
        slot = _slot(body.starts_at or old.starts_at, body.ends_at or old.ends_at)
        with _alternatives():
            return self.change(booking_id, services.booking_move, slot=slot, override=body.override)

    @_change_seen("bookings_cancel", "Cancel a booking, or finish it early")
    def delete(self, booking_id: UUID, query: CancelAsked) -> Response:
        """The rest of the slot is free for others at once."""
        return self.change(booking_id, services.booking_cancel, reason=query.reason)


class HandBookingView(BookingsBase):
    @_change_seen(
        "bookings_hand_over", "Ask a colleague to take a booking", answer=HandOfferEntry, keyed=True
    )
    def post(self, booking_id: UUID, body: HandBookingRequest) -> HandOfferEntry:
        """The rules must allow it for them. Until they accept, it stays yours. A new question replaces an open one."""
        version, found = version_seen(self.request), self.one(booking_id)
        to = services.colleague_named(body.to, self.person, found) if body.to else None
        asked: dict[str, Any] = {"booking_id": booking_id, "version": version, "to": to, "actor": self.person}
        offer, code = handing.hand_ask(**asked, now=timezone.now())
        link = public_url(self.request._request, reverse("hand-link", args=[code])) if code else None
        return _offer(offer, found, link)


class HandOffersView(BookingsBase):
    @reads("hand_offers_list", "List the bookings that colleagues want to hand you, or to share", refuses=())
    def get(self) -> HandOfferList:
        """Open offers to you, of robots that you may see."""
        found = handing.offers_to(self.person, timezone.now()).filter(booking__robot__in=self.robots())
        return HandOfferList([_offer(one, one.booking) for one in found])


class HandOfferView(BookingsBase):
    def concerned(self, offer_id: UUID, **_asked: Any) -> list[Robot]:
        return [self.offer(offer_id).booking.robot]

    def offer(self, offer_id: UUID) -> HandOffer:
        """Return an offer of a booking that the person may see. Raises `Http404`."""
        found = HandOffer.objects.filter(booking__in=self.seen()).select_related("booking__robot")
        return get_object_or_404(found, pk=offer_id)

    @_change("hand_offers_end", "Decline a colleague’s booking, or withdraw yours")
    def delete(self, offer_id: UUID) -> None:
        """The booking stays with its person."""
        offer, now = self.offer(offer_id), timezone.now()
        if offer.to_id == self.person.pk:
            handing.hand_answer(offer_id=offer.pk, actor=self.person, accept=False, now=now)
        else:
            handing.hand_withdraw(offer_id=offer.pk, actor=self.person, now=now)


class HandAcceptView(HandOfferView):
    http_method_names = ["post", "options"]

    @_change("hand_offers_accept", "Accept a colleague’s booking", keyed=True)
    def post(self, offer_id: UUID) -> Response:
        """From then on it is yours, and counts for you; or you share it (`share`)."""
        offer = self.offer(offer_id)
        made = handing.hand_answer(offer_id=offer.pk, actor=self.person, accept=True, now=timezone.now())
        return self.answer(made.pk)


class ApproveView(BookingsBase):
    @_change_seen("bookings_approve", "Approve a booking", keyed=True)
    def post(self, booking_id: UUID) -> Response:
        """For supervisors of the robot or of the booking’s course, and staff. Refused if the booking has
        changed since they read it."""
        return self.change(booking_id, services.booking_approve)


class AcceptView(BookingsBase):
    @_change("bookings_accept", "Accept an offer", keyed=True)
    def post(self, booking_id: UUID) -> Response:
        """For the person who waited for the slot, before `offer_until`."""
        self.one(booking_id)
        offer_accept(booking_id=str(booking_id), actor=self.person, now=timezone.now())
        return self.answer(booking_id)


class WaitingView(BookingsBase):
    @reads("waiting_list", "List the slots for which you wait", refuses=())
    def get(self) -> WaitingList:
        """Lists the slots to come for which you wait."""
        found = self.waiting().filter(starts_at__gt=timezone.now()).order_by("starts_at", "pk")
        return WaitingList([_waiting(one) for one in found])

    @_change("waiting_join", "Wait for a slot that is taken", answer=WaitingEntry, status=201, keyed=True)
    def post(self, body: WaitRequest) -> Response:
        """Refused if the slot is free, or another rule refuses it."""
        slot = _slot(body.starts_at, body.ends_at)
        made = waiting_join(
            robot=self.robot(body.robot),
            person=self.person,
            slot=slot,
            now=timezone.now(),
            purpose=body.purpose,
            course=_course(body.course, self.person),
            record_it=body.record,
        )
        headers = {"Location": f"/api/v1/waiting/{made.pk}"}
        return Response(wire.to_builtins(_waiting(made)), 201, headers=headers)

    def waiting(self) -> QuerySet[Waiting]:
        """Return the slots for which the person waits. The line for control now is at the robot's address."""
        mine = Waiting.objects.filter(person=self.person, robot__in=self.robots())
        return mine.exclude(starts_at=None).exclude(ends_at=None).select_related("robot", "course")


class WaitingOneView(WaitingView):
    http_method_names = ["delete", "options"]

    def concerned(self, number: int, **_asked: Any) -> list[Robot]:
        return [self.one_waiting(number).robot]

    def one_waiting(self, number: int) -> Waiting:
        """Return one of the slots for which the person waits. Raises `Http404`."""
        return get_object_or_404(self.waiting(), pk=min(number, 2**62))

    @_change("waiting_leave", "Wait no longer", refuses=(404,))
    def delete(self, number: int) -> None:
        """Leave the line for one slot."""
        waiting_leave(person=self.person, waiting_id=self.one_waiting(number).pk)


@contextmanager
def _alternatives() -> Iterator[None]:
    """Add free slots to the refusal of a booking."""
    try:
        yield
    except BookingRefused as error:
        extensions = {"alternatives": _slots(services.alternatives_of(error))}
        raise Problem(error.refusal, others=error.refusals, extensions=extensions) from error


def _slot(starts_at: datetime, ends_at: datetime) -> Slot:
    return Slot(utc(starts_at), utc(ends_at))


def _slots(found: list[tuple[Robot, Slot]]) -> list[SlotEntry]:
    return [SlotEntry(robot.slug, slot.starts_at, slot.ends_at) for robot, slot in found]


def _course(slug: str | None, person: User) -> Course | None:
    """Return the chosen course of this person. Raises `Http404`."""
    return None if slug is None else get_object_or_404(Course, enrolments__person=person, slug=slug)


def _offer(offer: HandOffer, booking: Booking, link: str | None = None) -> HandOfferEntry:
    return entry_of(
        HandOfferEntry,
        offer,
        booking=booking.pk,
        robot=booking.robot.slug,
        starts_at=booking.starts_at,
        ends_at=booking.ends_at,
        by=offer.by.display_name,
        to=offer.to.display_name if offer.to else None,
        link=link,
    )


def _waiting(one: Waiting) -> WaitingEntry:
    return entry_of(
        WaitingEntry,
        one,
        number=one.pk,
        robot=one.robot.slug,
        course=one.course and one.course.slug,
        record=bool(one.record),
    )
