"""Booking policies of robots, robot groups and all robots, and periods in which a robot is out of service."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal
from uuid import UUID

from django.db import transaction
from django.db.models import Q
from django.shortcuts import get_object_or_404
from django.utils import timezone
from msgspec import Meta, Struct
from rest_framework.response import Response

from fleet.bookings.changes import policy_changes
from fleet.bookings.models import MOST_INTERVALS, OutOfService, Policy
from fleet.bookings.selectors import policies_of
from robots.access.models import RobotGroup
from robots.access.selectors import robots_managed_by
from robots.registry.models import Robot
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.framework.parameters import Moment, Time, utc
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.setup.base import SetupView, edits, faults_named, makes, manages

Weekday = Literal["mon", "tue", "wed", "thu", "fri", "sat", "sun"]
Clock = Annotated[str, Meta(pattern=r"^(([01][0-9]|2[0-3]):[0-5][0-9]|24:00)$")]
Minutes = Annotated[int, Meta(ge=0, le=43200)]
Quota = Annotated[int, Meta(ge=1, le=10080)]
Why = Literal["repair", "battery", "research", "other"]

_NOT_MANAGED = Refusal(
    "permission_denied", "Only a supervisor of the robot itself or staff may change this.", "account"
)


class Rules(Struct, frozen=True, forbid_unknown_fields=True):
    """A booking policy: times in minutes; null: no limit."""

    # Intervals in order, in the lab's time; a day left out is closed; empty: always open
    opening: dict[
        Weekday, Annotated[list[tuple[Clock, Clock]], Meta(min_length=1, max_length=MOST_INTERVALS)]
    ]
    shortest_min: Minutes
    longest_min: Minutes
    horizon_days: Annotated[int, Meta(ge=0, le=730)]
    notice_min: Minutes  # before the slot, to book
    cancel_notice_min: Minutes
    gap_min: Minutes  # between two bookings of one person
    day_min: Quota | None  # per person
    week_min: Quota | None
    at_once: Quota | None  # bookings to come per person
    robots_at_once: Annotated[int, Meta(ge=1, le=100)]  # that one person may book for the same time
    grace_min: Minutes  # a slot whose person does not come within this time is free again
    needs_approval: bool
    free_time: bool  # time that nobody has booked is free to take


class PolicyEntry(Struct, frozen=True):
    """The policy that a robot, a group or all robots follow. `own` false: that of its group or of all robots."""

    robot: str | None
    group: str | None
    own: bool
    rules: Rules


class PolicyList(Struct, frozen=True):
    """Policies: of all robots first (`robot` and `group` null), of groups that have their own, then of robots."""

    policies: list[PolicyEntry]


class PeriodEntry(Struct, frozen=True):
    """A period in which a robot cannot be driven. `ends_at` null: until further notice."""

    id: UUID
    robot: str
    starts_at: Time
    ends_at: Time | None
    why: Why
    note: str


class PeriodList(Struct, frozen=True):
    """Periods that are not over, earliest first."""

    periods: list[PeriodEntry]


class PeriodMade(PeriodEntry, frozen=True, kw_only=True):
    """A new period, and the bookings that it affects; their people learn it."""

    affected: list[UUID]


class PeriodRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new period. `starts_at` null: now."""

    robot: Annotated[str, Meta(min_length=1, max_length=100)]
    why: Why
    starts_at: Moment | None = None
    ends_at: Moment | None = None
    note: Annotated[str, Meta(max_length=200)] = ""


class PoliciesBase(SetupView):
    tag = "policies"

    def managed(self) -> list[Robot]:
        """Return the robots that the person manages and that the token serves."""
        return [robot for robot in robots_managed_by(self.person) if self.serves([robot])]

    def managed_robot(self, slug: str) -> Robot:
        """Return one of these robots. Raises `Problem`: not found, or not managed."""
        robot = self.robot(slug)
        if robot not in self.managed():
            raise Problem(_NOT_MANAGED)
        return robot

    def entry(self, robot: Robot | None = None, group: RobotGroup | None = None) -> PolicyEntry:
        """Return the policy that a robot or a group follows; without either, the policy of all robots."""
        stored = Policy.objects.filter(robot=robot, group=group).first()
        followed = stored or (policies_of({robot})[robot.id] if robot else _common())
        return PolicyEntry(
            robot.slug if robot else None, group.slug if group else None, stored is not None, _rules(followed)
        )

    def changed(self, body: Rules, **of: Any) -> Response:
        """Set a policy, if nobody changed it after the client read it. Raises `Problem`."""
        values = wire.to_builtins(body)
        with transaction.atomic():
            place = Policy.objects.filter(robot=of.get("robot"), group=of.get("group"))
            place.select_for_update(of=("self",)).first()  # locked between check and change
            self.require_unchanged(self.entry(**of))
            with faults_named():
                policy_changes.policy_set(values=values, actor=self.person, **of)
        return self.tagged(self.entry(**of))


class PoliciesView(PoliciesBase):
    @reads("policies_list", "List booking policies", refuses=())
    def get(self) -> PolicyList:
        """Policies of the robots that you may see: the rules of booking are open to all who may book."""
        robots = self.robots()
        entries = [self.entry()]
        entries += [
            self.entry(group=one)
            for one in RobotGroup.objects.filter(booking_policy__isnull=False)
            if self.person.is_staff and self.serves(one.robots.all())
        ]
        own = set(Policy.objects.filter(robot__in=robots).values_list("robot_id", flat=True))
        followed = policies_of(set(robots))
        entries += [
            PolicyEntry(robot.slug, None, robot.id in own, _rules(followed[robot.id])) for robot in robots
        ]
        return PolicyList(entries)


class CommonPolicyView(PoliciesBase):
    @reads("policies_read_common", "Read the policy of all robots", answer=PolicyEntry, refuses=())
    def get(self) -> Response:
        """Robots without a policy of their own or of a group follow this one."""
        return self.tagged(self.entry())

    @edits(
        "policies_set_common",
        "Set the policy of all robots",
        takes_time=True,
        refuses=(412, 428),
        answer=PolicyEntry,
    )
    def put(self, body: Rules) -> Response:
        """For staff."""
        self.staff()
        return self.changed(body)


class RobotPolicyView(PoliciesBase):
    @reads("policies_read_robot", "Read the policy of a robot", answer=PolicyEntry)
    def get(self, slug: str) -> Response:
        """The robot’s own policy, or the one that it follows."""
        return self.tagged(self.entry(robot=self.robot(slug)))

    @edits("policies_set_robot", "Set the policy of a robot", takes_time=True, answer=PolicyEntry)
    def put(self, slug: str, body: Rules) -> Response:
        """For supervisors of the robot itself, and staff. Bookings that are made stay."""
        return self.changed(body, robot=self.managed_robot(slug))

    @manages("policies_remove_robot", "Remove the policy of a robot", takes_time=True)
    def delete(self, slug: str) -> None:
        """The robot follows the policy of its group, or of all robots, again."""
        policy_changes.policy_remove(robot=self.managed_robot(slug), actor=self.person)


class GroupPolicyView(PoliciesBase):
    def concerned(self, slug: str, **_asked: Any) -> Iterable[Robot]:
        return self.group(slug).robots.all()

    @reads("policies_read_group", "Read the policy of a robot group", answer=PolicyEntry)
    def get(self, slug: str) -> Response:
        """For staff: a group may have robots of several supervisors."""
        return self.tagged(self.entry(group=self.group(slug)))

    @edits("policies_set_group", "Set the policy of a robot group", takes_time=True, answer=PolicyEntry)
    def put(self, slug: str, body: Rules) -> Response:
        """For staff."""
        return self.changed(body, group=self.group(slug))

    @manages("policies_remove_group", "Remove the policy of a robot group", takes_time=True)
    def delete(self, slug: str) -> None:
        """Its robots follow the policy of all robots again."""
        policy_changes.policy_remove(group=self.group(slug), actor=self.person)


class PeriodsView(PoliciesBase):
    def concerned(self, body: PeriodRequest, **_asked: Any) -> Iterable[Robot]:
        return [self.robot(body.robot)]

    @reads("out_of_service_list", "List out-of-service periods", refuses=())
    def get(self) -> PeriodList:
        """Out-of-service periods of the robots that you may see."""
        open_now = Q(ends_at=None) | Q(ends_at__gt=timezone.now())
        found = OutOfService.objects.filter(open_now, robot__in=self.robots()).select_related("robot")
        return PeriodList([entry_of(PeriodEntry, one, robot=one.robot.slug) for one in found])

    @makes("out_of_service_add", "Take a robot out of service", takes_time=True, keyed=True)
    def post(self, body: PeriodRequest) -> PeriodMade:
        """For supervisors of the robot itself, and staff. Bookings stay: their people learn that they are affected."""
        now = timezone.now()
        with faults_named():
            period, affected = policy_changes.out_of_service_add(
                robot=self.managed_robot(body.robot),
                starts_at=utc(body.starts_at) if body.starts_at else now,
                ends_at=utc(body.ends_at) if body.ends_at else None,
                why=body.why,
                note=body.note,
                actor=self.person,
                now=now,
            )
        return entry_of(PeriodMade, period, robot=body.robot, affected=[booking.pk for booking in affected])


class PeriodView(PoliciesBase):
    def concerned(self, period_id: UUID, **_asked: Any) -> Iterable[Robot]:
        return [self.period(period_id).robot]

    def period(self, period_id: UUID) -> OutOfService:
        """Return a period of a robot that the person manages. Raises `Http404`."""
        return get_object_or_404(OutOfService, pk=period_id, robot__in=self.managed())

    @manages("out_of_service_end", "Put a robot back into service")
    def delete(self, period_id: UUID) -> None:
        """The period ends now; one that has not begun is removed."""
        found = self.period(period_id)
        policy_changes.out_of_service_end(period_id=found.pk, actor=self.person, now=timezone.now())


def _common() -> Policy:
    return Policy.objects.filter(robot=None, group=None).first() or Policy()


def _rules(policy: Policy) -> Rules:
    return entry_of(Rules, policy)
