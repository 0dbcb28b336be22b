"""Reading access: roles on robots and where they come from, courses, missing qualifications.

A person's role on a robot is the highest of two: the role that was given on the robot or its groups, and the roles by
the person's courses that are valid today.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from datetime import date, datetime
from typing import Any
from uuid import UUID

from django.db.models import Min, Q, QuerySet
from django.shortcuts import get_object_or_404
from django.utils import timezone
from django.utils.formats import date_format
from django.utils.translation import gettext
from msgspec import Struct

from fleet.accounts.models import User
from robots.access.models import Course, Qualification, QualificationGrant, RobotGroup
from robots.access.role_rows import Given, demanded, given
from robots.registry.models import Robot, RobotRole, Role


def lab_date(moment: datetime | None = None) -> date:
    """Return the date in the lab's time zone, now or at `moment`."""
    return timezone.localtime(moment, timezone.get_default_timezone()).date()


# --- roles ----------------------------------------------------------------------------------------


def _given(
    people: Collection[UUID], robots: Collection[UUID] | None, at: datetime | None = None
) -> list[Given]:
    return given(people, robots, lab_date(at))


def role_on(user: User, robot: Robot, at: datetime | None = None) -> Role | None:
    """Return the role of `user` on `robot`, now or at `at`; None: the person may not see the robot."""
    return roles_of(user, [robot], at).get(robot.id)


def roles_of(user: User, robots: Iterable[Robot], at: datetime | None = None) -> dict[UUID, Role]:
    """Return `role_on` for many robots, by one query; robots without a role are left out."""
    return roles_by_id(user, [robot.id for robot in robots], at)


def roles_by_id(user: User, ids: Sequence[UUID], at: datetime | None = None) -> dict[UUID, Role]:
    """Return `roles_of` for robots of which only the keys are known."""
    if not user.is_active:
        return {}
    if user.is_staff:
        return dict.fromkeys(ids, Role.STAFF)
    held: dict[UUID, Role] = {}
    for one in _given([user.id], ids, at):
        held[one.robot] = max(one.role, held.get(one.robot, one.role))
    return held


def roles_on(robot_id: UUID, users: Iterable[User]) -> dict[UUID, Role]:
    """Return `role_on` for many people, by one query; people without a role are left out."""
    active = {user.id: user for user in users if user.is_active}
    others = [user.id for user in active.values() if not user.is_staff]
    held = {user.id: Role.STAFF for user in active.values() if user.is_staff}
    for one in _given(others, [robot_id]):
        held[one.person] = max(one.role, held.get(one.person, one.role))
    return held


def supervises(user: User, robot: Robot) -> bool:
    """Return whether `user` is a supervisor of the robot or staff."""
    role = role_on(user, robot)
    return role is not None and role >= Role.SUPERVISOR


def manages_robot(user: User, robot: Robot) -> bool:
    """Return whether `user` is staff, or a supervisor of the robot or its groups; not only by a course."""
    return robots_managed_by(user).filter(pk=robot.pk).exists()


def robots_managed_by(user: User) -> QuerySet[Robot]:
    """Return the robots whose bookings and policy `user` manages, sorted by name; for staff all robots."""
    robots = Robot.objects.select_related("profile")
    if not user.is_active:
        return robots.none()
    if user.is_staff:
        return robots
    own = RobotRole.objects.filter(user=user, role=Role.SUPERVISOR).values("robot")
    of_groups = RobotGroup.objects.filter(roles__user=user, roles__role=Role.SUPERVISOR)
    return robots.filter(Q(pk__in=own) | Q(pk__in=of_groups.values("robots")))


def robots_supervised_by(user: User) -> QuerySet[Robot]:
    """Return the robots that a person supervises, also only by a course, and also by a course that begins later."""
    robots = robots_bookable_by(user)
    if user.is_staff:
        return robots
    found = given([user.id], None, lab_date(), date.max) if user.is_active else []
    return robots.filter(pk__in=[one.robot for one in found if one.role >= Role.SUPERVISOR])


def robots_visible_to(user: User) -> QuerySet[Robot]:
    """Return the robots that `user` may see, including disabled ones, sorted by name."""
    keys, _role = visible_to(user)
    robots = Robot.objects.select_related("profile", "bridge")
    return robots if keys is None else robots.filter(pk__in=keys)


def visible_to(user: User) -> tuple[set[UUID] | None, Role | None]:
    """Return the keys of the robots that `user` may see (None: all), and the highest role on any of them."""
    return _robots_and_role(user, None)


def visible_to_each(users: Collection[User]) -> dict[UUID, set[UUID] | None]:
    """Return, for each of these people, the keys of the robots that they may see (None: all). Makes one query."""
    return {user: None if held is None else set(held) for user, held in roles_of_each(users).items()}


def roles_of_each(users: Collection[User]) -> dict[UUID, dict[UUID, Role] | None]:
    """Return, for each of these people, their roles by robot (None: staff, on all robots). Makes one query."""
    active = [user for user in users if user.is_active]
    roles: dict[UUID, dict[UUID, Role] | None] = {user.id: None if user.is_staff else {} for user in active}
    for one in _given([user.id for user in active if not user.is_staff], None):
        if (held := roles[one.person]) is not None:
            held[one.robot] = max(one.role, held.get(one.robot, one.role))
    return roles


def robots_bookable_by(user: User) -> QuerySet[Robot]:
    """Return the robots that `user` may see today, or may drive in a course that begins later."""
    keys, _role = bookable_by(user)
    robots = Robot.objects.select_related("profile")
    return robots if keys is None else robots.filter(pk__in=keys)


def bookable_by(user: User) -> tuple[set[UUID] | None, Role | None]:
    """Return the keys of `robots_bookable_by` (None: all), and the highest role on any of them."""
    return _robots_and_role(user, date.max)


def _robots_and_role(user: User, last: date | None) -> tuple[set[UUID] | None, Role | None]:
    if not user.is_active:
        return set(), None
    if user.is_staff:
        return None, Role.STAFF
    roles = given([user.id], None, lab_date(), last)
    found = [one for one in roles if one.begun or one.role >= Role.OPERATOR]
    return {one.robot for one in found}, max((one.role for one in found), default=None)


def robot_visible_to(user: User, slug: str) -> Robot:
    """Return the robot if `user` may see it; else raise `Http404`."""
    return get_object_or_404(robots_visible_to(user), slug=slug)


def _of_courses(courses: Any) -> Q:
    """Return the query condition for robots of these courses, directly or by a group."""
    direct = Course.robots.through.objects.filter(course__in=courses)
    grouped = RobotGroup.robots.through.objects.filter(robotgroup__courses__in=courses)
    return Q(pk__in=direct.values("robot")) | Q(pk__in=grouped.values("robot"))


# --- courses --------------------------------------------------------------------------------------


def robots_of(course: Course) -> QuerySet[Robot]:
    """Return the course's robots, its own and those of its groups, sorted by name."""
    return Robot.objects.filter(_of_courses([course.pk]))


def may_manage(user: User, course: Course) -> bool:
    """Return whether `user` may change the course's people and grant its qualifications."""
    if not user.is_active:
        return False
    return user.is_staff or course.supervisors.filter(pk=user.pk).exists()


def courses_managed_by(user: User) -> QuerySet[Course]:
    """Return the courses that `user` may manage; for staff all courses."""
    if not user.is_active:
        return Course.objects.none()
    return Course.objects.all() if user.is_staff else Course.objects.filter(supervisors=user)


def courses_to_come(user: User) -> QuerySet[Course]:
    """Return the courses that begin later, and that `user` supervises or will drive robots in; the earliest first."""
    mine = Q(enrolments__person=user, role=Role.OPERATOR) | Q(supervisors=user)
    courses = Course.objects.filter(mine, archived=False, starts_on__gt=lab_date())
    return courses.distinct().order_by("starts_on")


def people_of(course: Course) -> QuerySet[User]:
    """Return the people who are enrolled in the course, and its supervisors."""
    return User.objects.filter(Q(enrolments__course=course) | Q(supervised_courses=course)).distinct()


# --- qualifications -------------------------------------------------------------------------------


def demanded_in(course: Course) -> QuerySet[Qualification]:
    """Return the qualifications that the course's robots demand."""
    robots = set(robots_of(course).values_list("pk", flat=True))
    return Qualification.objects.filter(Q(robots__in=robots) | Q(groups__robots__in=robots)).distinct()


def grants_in(
    course: Course, now: datetime, people: Collection[UUID] | None = None
) -> dict[UUID, list[QualificationGrant]]:
    """Return, by person, the valid grants of qualifications that its robots demand (None: of all its people)."""
    valid = QualificationGrant.objects.filter(Q(expires_at=None) | Q(expires_at__gt=now)).filter(
        qualification__in=demanded_in(course), person__in=people_of(course)
    )
    if people is not None:
        valid = valid.filter(person__in=people)
    held: dict[UUID, list[QualificationGrant]] = {}
    for grant in valid.select_related("qualification"):
        held.setdefault(grant.person_id, []).append(grant)
    return held


def missing_qualifications(
    user: User, robot: Robot, now: datetime, demands: Collection[int] | None = None
) -> list[Qualification]:
    """Return the qualifications that the robot demands and `user` does not have at `now`. Staff need none."""
    return lacking(robot, [user], now, demands).get(user.id, [])


def lacking(
    robot: Robot, users: Iterable[User], now: datetime, demands: Collection[int] | None = None
) -> dict[UUID, list[Qualification]]:
    """Return `missing_qualifications` for many people; people who lack none are left out.

    Makes one query, or three if the robot demands qualifications. `demands`: the keys of the demanded qualifications,
    if the caller has read them already.
    """
    people = [user.id for user in users if not user.is_staff]
    keys = (demanded(robot.id) if demands is None else demands) if people else ()
    if not keys:
        return {}
    wanted = list(Qualification.objects.filter(pk__in=keys))
    grants = QualificationGrant.objects.filter(qualification__in=keys, person_id__in=people)
    valid = grants.filter(Q(expires_at=None) | Q(expires_at__gt=now))
    held = set(valid.values_list("person_id", "qualification_id"))
    lacks = {person: [one for one in wanted if (person, one.pk) not in held] for person in people}
    return {person: found for person, found in lacks.items() if found}


def qualified_until(user: User, demands: Collection[int]) -> datetime | None:
    """Return the time when the first of the user's demanded qualifications expires; None if none expires."""
    if user.is_staff or not demands:
        return None
    grants = QualificationGrant.objects.filter(qualification__in=demands, person=user)
    until: datetime | None = grants.aggregate(until=Min("expires_at"))["until"]
    return until


# --- why ------------------------------------------------------------------------------------------


class Source(Struct, frozen=True):
    """Source of a role: a course, or staff, who gave it on the robot or on a group; or the person is staff."""

    role: Role
    course: Course | None = None
    group: RobotGroup | None = None

    @property
    def words(self) -> str:
        """Return the source in words, such as "operator by course HRI 2026, until 31 January 2027"."""
        role = {
            Role.OBSERVER: gettext("observer"),
            Role.OPERATOR: gettext("operator"),
            Role.SUPERVISOR: gettext("supervisor"),
            Role.STAFF: gettext("staff, on every robot"),
        }[self.role]
        if self.group is not None:
            facts = {"role": role, "group": self.group.name}
            return gettext("%(role)s by robot group %(group)s, given by staff") % facts
        if self.course is None:
            return role if self.role is Role.STAFF else gettext("%s, given by staff") % role
        facts = {
            "role": role,
            "course": self.course.name,
            "until": date_format(self.course.ends_on, "DATE_FORMAT"),
        }
        return gettext("%(role)s by course %(course)s, until %(until)s") % facts


class Reason(Struct, frozen=True):
    """A robot, a person's role on it with all sources (the highest first), and the missing qualifications."""

    robot: Robot
    role: Role
    sources: tuple[Source, ...]
    missing: tuple[Qualification, ...]


def reasons(user: User, now: datetime) -> list[Reason]:
    """Return, for each robot that `user` may see, the role and its sources."""
    robots = list(robots_visible_to(user))
    if user.is_staff:
        staff = (Source(Role.STAFF),)
        return [Reason(robot, Role.STAFF, staff, ()) for robot in robots]
    found = _given([user.id], [robot.id for robot in robots], now)
    courses = Course.objects.in_bulk({one.course for one in found})
    groups = RobotGroup.objects.in_bulk({one.group for one in found})
    reasons_found = []
    for robot in robots:
        sources = [
            Source(one.role, courses.get(one.course), groups.get(one.group))
            for one in found
            if one.robot == robot.id
        ]
        sources.sort(key=lambda one: one.role.rank, reverse=True)
        if sources:
            missing = tuple(missing_qualifications(user, robot, now))
            reasons_found.append(Reason(robot, sources[0].role, tuple(sources), missing))
    return reasons_found
