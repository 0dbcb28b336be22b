"""Read bookings, and the facts that the rules check."""

from __future__ import annotations

from collections.abc import Collection
from datetime import UTC, date, datetime, timedelta
from enum import Enum
from functools import cache, partial
from typing import Protocol
from uuid import UUID

from django.conf import settings
from django.db.models import F, Q, QuerySet
from django.utils.translation import gettext_lazy, gettext_noop
from msgspec import Struct, structs

from fleet.accounts.models import User
from fleet.base.database import rows
from fleet.base.zones import viewers, zone_of
from fleet.bookings.hours.driven import driven
from fleet.bookings.lessons.members import shared_with
from fleet.bookings.models import Booking, Holiday, OutOfService, Policy, Shared, State
from fleet.bookings.rules import COURSE_QUOTAS, FAR, LONGEST, Quota, Slot, Taken, Wish
from robots.access.models import DRIVERS, Course, RobotGroup
from robots.access.role_rows import OWN, Given, demanded_by, given
from robots.access.selectors import lab_date, missing_qualifications, qualified_until, role_on
from robots.registry.models import Robot, Role

NOT_YET = (State.AWAITING, State.OFFERED)  # they hold a slot, but do not allow control
WEEK = timedelta(days=7)
SWITCHED_OFF = gettext_lazy("staff switched it off")

# Hand-written for speed, because fifty people may try to book one slot at the same moment.
_OWN = """
SELECT b.id, b.starts_at, b.held_until, b.used_at, b.robot_id, r.name, b.shared = 'course'
FROM bookings_booking b JOIN robots_robot r ON r.id = b.robot_id
WHERE b.person_id = %s AND b.starts_at > %s AND b.held_until > b.starts_at
ORDER BY b.starts_at
"""
_TAKEN = """
SELECT b.robot_id, b.id, CAST(b.starts_at AS text), CAST(b.held_until AS text), CAST(b.used_at AS text), b.person_id,
    CASE WHEN b.shared = 'course' THEN c.name ELSE COALESCE(NULLIF(p.full_name, ''), p.username) END
FROM bookings_booking b JOIN accounts_user p ON p.id = b.person_id LEFT JOIN access_course c ON c.id = b.course_id
WHERE b.robot_id IN ({robots}) AND b.starts_at > %s AND b.starts_at < %s AND b.held_until > %s
    AND b.held_until > b.starts_at
ORDER BY b.starts_at
"""


class Stage(Enum):
    """The stage of a booking at a moment, as people see it."""

    AWAITING = gettext_noop("awaiting approval")
    OFFERED = gettext_noop("offered to you from the waiting list")
    BOOKED = gettext_noop("booked")
    DUE = gettext_noop("not used yet")
    IN_USE = gettext_noop("in use")
    OVER = gettext_noop("over")
    FINISHED = gettext_noop("finished early")
    NO_SHOW = gettext_noop("not used")
    CANCELLED = gettext_noop("cancelled")


# People may still change bookings in these stages
OPEN = (Stage.AWAITING, Stage.OFFERED, Stage.BOOKED, Stage.DUE, Stage.IN_USE)
_ENDED: dict[str, Stage] = {
    State.FINISHED: Stage.FINISHED,
    State.NO_SHOW: Stage.NO_SHOW,
    State.CANCELLED: Stage.CANCELLED,
}


class Times(Protocol):
    """The columns of a booking from which its held time is computed."""

    @property
    def starts_at(self) -> datetime: ...
    @property
    def held_until(self) -> datetime: ...
    @property
    def used_at(self) -> datetime | None: ...


class Row(Times, Protocol):
    """The columns of a booking from which its stage is computed."""

    @property
    def state(self) -> str: ...


class _Held(Struct, frozen=True):
    """A booking that holds time."""

    id: UUID
    starts_at: datetime
    held_until: datetime
    used_at: datetime | None
    person_id: UUID
    name: str  # of the person


class _Own(Struct, frozen=True):
    """A booking of the person who wants another one."""

    id: UUID
    starts_at: datetime
    held_until: datetime
    used_at: datetime | None
    robot_id: UUID
    robot: str  # its name
    lesson: bool  # it is a lesson of a course


def stage_of(booking: Row, grace: timedelta, now: datetime) -> Stage:
    """Return the stage of a booking at this moment. An unused slot becomes a no-show after the grace time."""
    state = booking.state
    if state in _ENDED:
        return _ENDED[state]
    if booking.used_at is None and now >= booking.starts_at + grace and state == State.BOOKED:
        return Stage.NO_SHOW
    if state == State.AWAITING and now >= booking.starts_at + grace:
        return Stage.OVER
    if state == State.OFFERED:
        return Stage.OFFERED
    if now >= booking.held_until:
        return Stage.OVER
    if now < booking.starts_at:
        return Stage.AWAITING if state == State.AWAITING else Stage.BOOKED
    return Stage.IN_USE if booking.used_at else Stage.DUE


def held_slot(booking: Times, grace: timedelta, now: datetime) -> Slot:
    """Return the time in which others cannot book: a no-show ends after the grace time."""
    ends = booking.held_until
    if booking.used_at is None and now >= booking.starts_at + grace:
        ends = min(ends, booking.starts_at + grace)
    return Slot(booking.starts_at, ends)


def is_recorded(booking: Booking) -> bool:
    """Return whether the robot's topics are recorded in it: a rule of the lab, its person's wish, or its course's."""
    return bool(booking.record) or is_recorded_by_rule(booking)


def is_recorded_by_rule(booking: Booking) -> bool:
    """Return whether the robot's topics are recorded in it whatever its person wishes."""
    if settings.FLEET_RECORD_EVERY_BOOKING:
        return True
    return booking.shared == Shared.COURSE and booking.course is not None and booking.course.record_lessons


def policy_of(robot: Robot) -> Policy:
    """Return the robot's policy: its own, or that of a group, or that of all robots, or the defaults."""
    return policies_of([robot])[robot.id]


def policies_of(robots: Collection[Robot]) -> dict[UUID, Policy]:
    """Return `policy_of` for many robots. One query; two if a group has a policy."""
    chosen = Q(robot__in=robots) | Q(group__isnull=False) | Q(robot=None, group=None)
    found = list(Policy.objects.filter(chosen).select_related("group").order_by("group__name"))
    common = next((one for one in found if one.robot_id is None and one.group_id is None), Policy())
    policies = {robot.id: common for robot in robots}
    if groups := {one.group_id: one for one in reversed(found) if one.group_id is not None}:
        members = RobotGroup.robots.through.objects.filter(robotgroup__in=groups, robot__in=robots)
        for group, member in members.order_by("-robotgroup__name").values_list("robotgroup", "robot"):
            policies[member] = groups[group]
    for robot in robots:
        if (own := next((one for one in found if one.robot_id == robot.id), None)) is not None:
            own.robot = robot  # saves a query: the text of a refusal contains its name
            policies[robot.id] = own
    return policies


def grace_of(policy: Policy) -> timedelta:
    """Return the time after which an unused slot is free again."""
    return timedelta(minutes=policy.grace_min)


def _before(moment: datetime, by: timedelta) -> datetime:
    """Return the moment earlier by `by`; the moment itself if that is before the first year."""
    return moment - by if moment - datetime.min.replace(tzinfo=UTC) > by else moment


def held_between(robots: Collection[Robot], starts: datetime, ends: datetime) -> QuerySet[Booking]:
    """Return the bookings of these robots that hold time between two moments."""
    held = Booking.objects.filter(
        robot__in=robots, starts_at__gt=_before(starts, LONGEST), starts_at__lt=ends, held_until__gt=starts
    )
    return held.filter(held_until__gt=F("starts_at")).select_related("person", "robot", "course")


def bookings_of(person: User) -> QuerySet[Booking]:
    """Return a person's bookings, also those of others that they share, newest first."""
    mine = Q(person=person) | Q(pk__in=shared_with(person).values("pk"))
    return Booking.objects.filter(mine).select_related("robot", "course", "person").order_by("-starts_at")


def out_between(robot: Robot, starts: datetime, ends: datetime) -> list[Taken]:
    """Return a robot's out-of-service periods between two moments. For a disabled robot: one without end."""
    return _out([robot], starts, ends)[robot.id]


def _out(robots: Collection[Robot], starts: datetime, ends: datetime) -> dict[UUID, list[Taken]]:
    """Return `out_between` of each robot, by one query."""
    out = {one.id: [] if one.enabled else [Taken(Slot(starts, FAR), str(SWITCHED_OFF))] for one in robots}
    enabled = [one.id for one in robots if one.enabled]
    open_ended = Q(ends_at=None) | Q(ends_at__gt=starts)
    for one in (
        OutOfService.objects.filter(open_ended, robot__in=enabled, starts_at__lt=ends) if enabled else ()
    ):
        out[one.robot_id].append(Taken(Slot(one.starts_at, one.ends_at or FAR), why_out(one)))
    return out


def why_out(period: OutOfService) -> str:
    """Return the text of the reason why a robot is out of service."""
    return f"{period.get_why_display()}: {period.note}" if period.note else str(period.get_why_display())


def _taken(facts: RobotFacts, now: datetime, *, but: Booking | None, of: UUID) -> list[Taken]:
    """Return the bookings of a robot, except `but`, the one that is moved.

    `of`: the person with `own` bookings.
    """
    grace = grace_of(facts.policy)
    return [
        Taken(held_slot(one, grace, now), one.name, one.person_id == of)
        for one in facts.held
        if but is None or one.id != but.pk
    ]


class RobotFacts(Struct, frozen=True):
    """The facts of a robot for a slot. They are the same for all people who want the slot."""

    policy: Policy
    held: tuple[_Held, ...]  # bookings that hold time in the week from the slot's start on
    out: tuple[Taken, ...]  # out-of-service periods of that week
    demanded: frozenset[int]  # keys of qualifications
    holidays: tuple[Holiday, ...]  # that are not over at the slot's start


def robot_facts(robot: Robot, slot: Slot) -> RobotFacts:
    """Read a robot's facts for a slot. Five queries."""
    return facts_of([robot], slot)[robot.id]


def facts_of(robots: Collection[Robot], slot: Slot) -> dict[UUID, RobotFacts]:
    """Read `robot_facts` of each robot. Five queries for all."""
    keys = [robot.id for robot in robots]
    week = _week_from(slot)
    policies, held, demands = policies_of(robots), _held(keys, week), demanded_by(keys)
    out = _out(robots, week.starts_at, week.ends_at)
    holidays = tuple(Holiday.objects.filter(last_day__gte=_before(slot.starts_at, timedelta(days=1)).date()))
    return {
        key: RobotFacts(policies[key], tuple(held[key]), tuple(out[key]), frozenset(demands[key]), holidays)
        for key in keys
    }


def _held(robots: Collection[UUID], time: Slot) -> dict[UUID, list[_Held]]:
    """Return, by robot, the bookings that hold some of this time."""
    held: dict[UUID, list[_Held]] = {robot: [] for robot in robots}
    query = _TAKEN.format(robots=rows.marks(robots))
    asked = (*robots, _before(time.starts_at, LONGEST), time.ends_at, time.starts_at)
    # The end of one booking is often the start of the next: parse it only once
    moment, read_key = cache(rows.moment), cache(rows.key)
    for robot, key, starts_at, held_until, used_at, person, name in rows.read(query, asked) if robots else ():
        times = moment(starts_at), moment(held_until), used_at and moment(used_at)
        held[read_key(robot)].append(_Held(rows.key(key), *times, read_key(person), name))
    return held


def _week_from(slot: Slot) -> Slot:
    """Return the week from the slot's start on, or a longer slot."""
    starts = slot.starts_at
    return Slot(starts, max(slot.ends_at, min(starts, FAR - WEEK) + WEEK))


def wish_of(
    *,
    robot: Robot,
    person: User,
    slot: Slot,
    now: datetime,
    moved: Booking | None = None,
    course: Course | None = None,
    lesson: bool = False,
    facts: RobotFacts | None = None,
    asker: Asker | None = None,
) -> Wish:
    """Return the wish with the facts that the rules check.

    `moved`: the booking that the wish replaces. `course`: the chosen course, if several courses let the
    person drive the robot; without it, the slot counts for the first course whose quotas allow it. `lesson`:
    the slot is a lesson of a course. `facts`: the robot's facts for this slot, if they were read before.
    `asker`: what is known of the person.
    """
    asker = asker or Asker(person, [robot])
    facts = facts or robot_facts(robot, slot)
    policy, out = facts.policy, facts.out
    starts = slot.starts_at
    taken = _taken(facts, now, but=moved, of=person.pk)
    own = [one for one in asker.own(_far_back(policy, slot, now)) if moved is None or one.id != moved.pk]
    role, courses = asker.role_and_courses(robot, starts)
    first_day, last_day = days_of(slot)
    if first_day != last_day:  # a course may end before the slot does
        role = min((role, asker.role_and_courses(robot, slot.ends_at - timedelta.resolution)[0]), key=_rank)
    wish = Wish(
        robot=robot.name,
        slot=slot,
        now=now,
        policy=policy,
        lab=zone_of(""),
        zone=viewers(),
        role=role,
        role_until=_role_until(person, robot, starts, now) if _rank(role) < Role.OPERATOR.rank else None,
        missing=tuple(one.name for one in missing_qualifications(person, robot, starts, facts.demanded)),
        qualified_until=qualified_until(person, facts.demanded),
        own=tuple(Slot(one.starts_at, one.held_until) for one in own if not one.lesson),
        own_here=tuple(Slot(one.starts_at, one.held_until) for one in own if one.robot_id == robot.id),
        other_robots=_on_other_robots(own, robot, now),
        lesson=lesson,
        holidays=facts.holidays,
        taken=tuple(one for one in taken if one.slot.overlaps(slot)),
        out=tuple(one for one in out if one.slot.overlaps(slot)),
        busy=tuple(sorted((*taken, *out), key=lambda one: one.slot.starts_at)),
    )
    return _counted(wish, courses, asker, moved, course)


def _counted(
    wish: Wish, courses: list[Course], asker: Asker, moved: Booking | None, chosen: Course | None
) -> Wish:
    """Return the wish with the course for which it counts, and its quota.

    A moved booking keeps its course.
    """
    if chosen is not None and courses and chosen not in courses:
        return structs.replace(wish, wrong_course=chosen.name)
    stays = chosen or (moved.course if moved is not None else None)
    first: Wish | None = None
    for course in [stays] if stays in courses and stays is not None else courses:
        counted = structs.replace(wish, course=course, quota=asker.quota(course, wish.slot, wish.now, moved))
        if all(rule(counted) is None for rule in COURSE_QUOTAS):
            return counted
        first = first or counted
    return first or wish


def _rank(role: Role | None) -> int:
    return -1 if role is None else role.rank


def _role_until(person: User, robot: Robot, at: datetime, now: datetime) -> date | None:
    """Return the last day from now until `at` on which a course lets the person drive the robot, if any."""
    days = lab_date(now), lab_date(at)
    courses = Course.objects.filter(
        Q(robots=robot) | Q(groups__robots=robot),
        enrolments__person=person,
        role=Role.OPERATOR,
        archived=False,
    )
    ends = courses.filter(ends_on__range=days).order_by("-ends_on").values_list("ends_on", flat=True)
    return ends.first()


def courses_for(robot: Robot, person: User, at: datetime) -> list[Course]:
    """Return the courses for which a booking may count; none if the person may drive without a course."""
    return Asker(person, [robot]).role_and_courses(robot, at)[1]


class Asker:
    """A person who wants time on one of some robots. What is the same for several wishes is read once."""

    def __init__(self, person: User, robots: Collection[Robot]) -> None:
        self.person = person
        self._robots = [robot.id for robot in robots]
        self._given: dict[date, list[Given]] = {}
        self._own: tuple[datetime, list[_Own]] | None = None
        self.courses = cache(lambda keys: list(Course.objects.filter(pk__in=keys)))
        self.quota = cache(partial(_quota_of, person))

    def given(self, robot: Robot, day: date) -> list[Given]:
        """Return the sources of the person's role on the robot on a day."""
        if day not in self._given:
            self._given[day] = given([self.person.pk], self._robots, day)
        return [one for one in self._given[day] if one.robot == robot.id]

    def role_and_courses(self, robot: Robot, at: datetime) -> tuple[Role | None, list[Course]]:
        """Return the person's role, and the courses for which a booking may count (not those they supervise)."""
        if self.person.is_staff or not self.person.is_active:
            return role_on(self.person, robot, at), []
        found = self.given(robot, lab_date(at))
        role = max((one.role for one in found), default=None)
        enrolled = frozenset(one.course for one in found if one.course != OWN and one.role is Role.OPERATOR)
        alone = any(one.course == OWN and one.role >= Role.OPERATOR for one in found)
        return role, self.courses(enrolled) if enrolled and not alone else []

    def own(self, since: datetime) -> list[_Own]:
        """Return the person's bookings that begin later than `since`, or more of them."""
        if self._own is None or since < self._own[0]:
            found = rows.read(_OWN, (self.person.pk, since))
            self._own = (
                since,
                [
                    _Own(
                        rows.key(key),
                        rows.moment(starts_at),
                        rows.moment(held_until),
                        used_at and rows.moment(used_at),
                        rows.key(robot),
                        name,
                        bool(lesson),
                    )
                    for key, starts_at, held_until, used_at, robot, name, lesson in found
                ],
            )
        return self._own[1]


def _quota_of(person: User, course: Course, slot: Slot, now: datetime, moved: Booking | None) -> Quota:
    of_course = Booking.objects.filter(
        course=course,
        starts_at__gt=_before(min(now, slot.starts_at), WEEK + LONGEST),
        held_until__gt=F("starts_at"),
    )
    counted = of_course.exclude(shared=Shared.COURSE)
    if moved is not None:
        counted = counted.exclude(pk=moved.pk)
    rows = list(counted.values_list("starts_at", "held_until", "person_id"))
    if course.lessons_count == DRIVERS:
        lessons = of_course.filter(shared=Shared.COURSE)
        rows += [(drove.starts_at, drove.ends_at, who) for who, drove in driven(lessons, now)]
    return Quota(
        course.name,
        course.day_min,
        course.week_min,
        course.at_once,
        course.course_week_min,
        own=tuple(Slot(starts, ends) for starts, ends, person_id in rows if person_id == person.pk),
        all=tuple(Slot(starts, ends) for starts, ends, _ in rows),
    )


def _far_back(policy: Policy, slot: Slot, now: datetime) -> datetime:
    """Return the moment since which the policy's rules need the person's bookings."""
    if policy.day_min or policy.week_min or policy.at_once or policy.gap_min:
        return _before(min(now, slot.starts_at), WEEK + LONGEST)
    return _before(slot.starts_at, LONGEST)


def _on_other_robots(own: list[_Own], robot: Robot, now: datetime) -> tuple[Taken, ...]:
    """Return the person's bookings of other robots that hold time and are no lessons of a course."""
    others = [one for one in own if one.robot_id != robot.id and not one.lesson]
    begun = {one.robot_id for one in others if one.used_at is None and one.starts_at <= now}
    policies = policies_of(Robot.objects.filter(pk__in=begun)) if begun else {}
    found = []
    for one in others:
        policy = policies.get(one.robot_id)  # that robot's grace time decides whether it is a no-show
        held = held_slot(one, grace_of(policy), now) if policy else Slot(one.starts_at, one.held_until)
        found.append(Taken(held, one.robot))
    return tuple(found)


def days_of(slot: Slot) -> tuple[date, date]:
    """Return the lab's days on which a slot begins and ends. An end at midnight belongs to the day before."""
    return lab_date(slot.starts_at), lab_date(max(slot.starts_at, slot.ends_at - timedelta.resolution))
