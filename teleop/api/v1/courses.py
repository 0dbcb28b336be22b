"""Courses and their members, for people who manage them. Other people get the answer "not found"."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal

from django.db import transaction
from django.db.models import Count, Q, QuerySet
from django.utils import timezone
from msgspec import UNSET, Meta, Struct, UnsetType, structs
from rest_framework.response import Response

from fleet.accounts.models import User
from fleet.base.web.origin import public_origin
from robots.access import enrolment, services
from robots.access.models import Course, Qualification
from robots.access.pages.forms import ActionForm, end_of
from robots.access.people_lists.reading import read_people
from robots.access.selectors import courses_managed_by, demanded_in, grants_in, lab_date, people_of, robots_of
from robots.registry.models import Robot
from robots.registry.selectors import free_slug
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import Entry, entry_of
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.setup.base import SetupView, edits, faults_named, makes, manages, named_groups
from teleop.api.v1.setup.groups import account_named

_NO_ROBOT = Refusal("robot_needed", "Name at least one robot or robot group.", "wire")


class CourseEntry(Struct, frozen=True):
    """A course in a list."""

    slug: str
    name: str
    role: str  # of its people
    starts_on: date
    ends_on: date  # included, in the lab's time zone
    archived: bool
    valid: bool  # its people have its role today
    people: int


LessonsCount = Literal["nobody", "drivers"]


class CourseList(Struct, frozen=True):
    """Courses that you manage: those that end last come first, archived ones at the end."""

    courses: list[CourseEntry]


class Quotas(Struct, frozen=True):
    """Minutes that may be booked, and bookings to come; null: no quota."""

    day_min: int | None
    week_min: int | None
    at_once: int | None
    course_week_min: int | None  # of all its people together


class QualificationEntry(Struct, frozen=True):
    """A qualification that a robot of the course demands."""

    slug: str
    name: str


class CourseDetail(CourseEntry, frozen=True):
    """A course."""

    robots: list[str]  # of its groups, too
    groups: list[str]
    supervisors: list[str]  # names
    quotas: Quotas
    lessons_count: LessonsCount  # whose quotas lessons use
    record_lessons: bool  # what the robots sense in its lessons is recorded
    qualifications: list[QualificationEntry]


class HeldQualification(Struct, frozen=True):
    """A qualification that a person holds; `expires_at` null: for good."""

    qualification: str
    expires_at: Time | None


class Member(Struct, frozen=True):
    """A person in a course."""

    username: str
    name: str
    email: str
    number: str  # of the student, as the course's list gave it; "": none
    since: Time
    active: bool  # the account is open
    qualifications: list[HeldQualification]


class MemberList(Struct, frozen=True):
    """The people of a course, by name."""

    members: list[Member]


class EnrolRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """People, one per line: `Ada Lovelace <ada@example.org>`, or as CSV with titles, also of a student number.

    `preview`: only tell the effect.
    """

    list: Annotated[str, Meta(min_length=1)]
    preview: bool = False


class ListedPerson(Struct, frozen=True):
    """A person of the list. A new account comes with an e-mail with a link to set a password."""

    name: str
    email: str  # "": the list has a student number only
    number: str


class WrongLine(Struct, frozen=True):
    """A line that cannot be used."""

    line: int
    text: str
    reason: str


class EnrolAnswer(Struct, frozen=True):
    """The effect of a list."""

    enrolled: int  # number of people; 0 for a preview
    known: list[str]  # user names of accounts that are enrolled
    new: list[ListedPerson]  # people who get an account
    # Enrolled by a supervisor: supervisors do not learn whether these people had an account.
    undisclosed: list[ListedPerson]
    already: list[str]  # user names of people who were in the course before
    wrong: list[WrongLine]  # lines that were left out
    notes: list[str]


Names = Annotated[list[str], Meta(max_length=1000)]
Minutes = Annotated[int, Meta(ge=1)]


class QuotasRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Minutes, and bookings to come; null: no quota."""

    day_min: Minutes | None = None
    week_min: Minutes | None = None
    at_once: Minutes | None = None
    course_week_min: Minutes | None = None


class CourseRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new course: at least one robot or robot group (slugs); supervisors by user name."""

    name: Annotated[str, Meta(min_length=1, max_length=80)]
    starts_on: date
    ends_on: date  # included, in the lab's time zone
    role: Literal["observer", "operator"] = "operator"  # of its people
    robots: Names = []
    groups: Names = []
    supervisors: Names = []
    quotas: QuotasRequest = QuotasRequest()
    lessons_count: LessonsCount = "nobody"  # or the minutes that each person drove
    record_lessons: bool = False


class CourseChange(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Fields that are left out stay as they are."""

    name: Annotated[str, Meta(min_length=1, max_length=80)] | UnsetType = UNSET
    starts_on: date | UnsetType = UNSET
    ends_on: date | UnsetType = UNSET
    role: Literal["observer", "operator"] | UnsetType = UNSET
    robots: Names | UnsetType = UNSET
    groups: Names | UnsetType = UNSET
    supervisors: Names | UnsetType = UNSET
    quotas: QuotasRequest | UnsetType = UNSET
    lessons_count: LessonsCount | UnsetType = UNSET
    record_lessons: bool | UnsetType = UNSET
    archived: bool | UnsetType = UNSET


class PeopleRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """User names of members, for qualifications also of supervisors; null: everybody who is enrolled."""

    people: Annotated[list[str], Meta(min_length=1, max_length=1000)] | None


class GrantRequest(PeopleRequest, frozen=True, forbid_unknown_fields=True):
    """`last_day`: until when it is valid, included, in the lab's time zone; null: for good."""

    last_day: date | None = None


class Changed(Struct, frozen=True):
    """For how many people something changed."""

    people: int


class CoursesAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Filters of courses."""

    archived: bool | None = None
    robot: Annotated[str, Meta(max_length=100, description="That the course serves.")] | None = None
    on: Annotated[date, Meta(description="A day of the course’s term.")] | None = None


class MembersAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Filter of members."""

    q: Annotated[str, Meta(max_length=100, description="Part of a name, user name or address.")] = ""


class CoursesBase(SetupView):
    tag = "courses"

    def concerned(
        self, slug: str | None = None, qualification: str | None = None, body: Any = None, **_asked: Any
    ) -> Iterable[Robot]:
        """Return the robots of the course and its new ones, and those that demand the qualification."""
        found = list(robots_of(self.course(slug))) if slug else []
        if isinstance(groups := getattr(body, "groups", None), list):
            found += [robot for group in named_groups(groups) for robot in group.robots.all()]
        if isinstance(robots := getattr(body, "robots", None), list):
            found += self.named_robots(robots)
        if qualification:
            demanded = Q(qualifications__slug=qualification) | Q(groups__qualifications__slug=qualification)
            found += Robot.objects.filter(demanded)
        return found

    def detail(self, course: Course) -> CourseDetail:
        """Return a course with its robots, supervisors, quotas and qualifications."""
        return _entry(
            CourseDetail,
            course,
            robots=[robot.slug for robot in robots_of(course)],
            groups=[group.slug for group in course.groups.all()],
            supervisors=[person.display_name for person in course.supervisors.all()],
            quotas=Quotas(course.day_min, course.week_min, course.at_once, course.course_week_min),
            qualifications=[entry_of(QualificationEntry, one) for one in self.qualifications(course)],
        )

    def save(self, course: Course, body: CourseRequest | CourseChange) -> None:
        """Save a course with the fields of the request. Raises `Problem`."""
        new = course._state.adding
        lists: dict[str, Any] = {
            "robots": [] if new else list(course.robots.all()),
            "groups": [] if new else list(course.groups.all()),
            "supervisors": [] if new else list(course.supervisors.all()),
        }
        if isinstance(body.robots, list):
            lists["robots"] = self.named_robots(body.robots)
        if isinstance(body.groups, list):
            lists["groups"] = named_groups(body.groups)
        if isinstance(body.supervisors, list):
            lists["supervisors"] = [account_named(name) for name in dict.fromkeys(body.supervisors)]
        if not lists["robots"] and not lists["groups"]:
            raise Problem(_NO_ROBOT)
        plain = {
            name: getattr(body, name)
            for name in ("name", "starts_on", "ends_on", "role", "lessons_count", "record_lessons")
        }
        quotas = structs.asdict(body.quotas) if isinstance(body.quotas, QuotasRequest) else {}
        for name, value in (plain | quotas).items():
            if value is not UNSET:
                setattr(course, name, value)
        with faults_named():
            services.course_save(course=course, actor=self.staff(), **lists)

    def courses(self) -> list[Course]:
        """Return the courses that the person manages, if the token serves every robot of the course."""
        token = self.token
        found = courses_managed_by(self.person).annotate(people=Count("enrolments", distinct=True))
        return [course for course in found if token is None or self.serves(robots_of(course))]

    def course(self, slug: str) -> Course:
        """Return one of these courses. Raises `Problem`: not found."""
        found = courses_managed_by(self.person).filter(slug=slug).annotate(people=Count("enrolments"))
        course: Course | None = found.first()
        if course is None or not self.serves(robots_of(course)):
            raise Problem(NOT_FOUND)
        return course

    def qualifications(self, course: Course) -> list[Qualification]:
        """Return the qualifications that the course's robots demand.

        For a token that is bound to robots: only qualifications that no other robot demands.
        """
        return [
            one
            for one in demanded_in(course)
            if self.serves([*one.robots.all(), *Robot.objects.filter(groups__qualifications=one)])
        ]

    def chosen(
        self, slug: str, qualification: str, people: list[str] | None, last_day: date | None = None
    ) -> tuple[Qualification, list[User], date | None]:
        """Return qualification, people and last day, checked as on the page. Raises `Problem`."""
        course = self.course(slug)
        if qualification not in [one.slug for one in self.qualifications(course)]:
            raise Problem(NOT_FOUND)
        typed = {
            "person": []
            if people is None
            else [person.pk for person in named(people, people_of(course), course)],
            "everybody": people is None,
            "action": "grant",
            "qualification": qualification,
            "until": last_day,
        }
        form = ActionForm(typed, course=course, qualifications=demanded_in(course))
        if not form.is_valid():
            text = str(next(iter(form.errors.values()))[0])
            raise Problem(Refusal("invalid", text, "wire"))
        values = form.cleaned_data
        return values["qualification"], values["people"], values["until"]

    def members(self, course: Course, people: list[str] | None) -> list[User]:
        """Return the enrolled people with these user names; None: everybody. Raises `Problem`."""
        enrolled = User.objects.filter(enrolments__course=course)
        return list(enrolled) if people is None else named(people, enrolled, course)


class CoursesView(CoursesBase):
    @manages("courses_list", "List the courses that you manage")
    def get(self, query: CoursesAsked) -> CourseList:
        """Staff manage all."""
        found = self.courses()
        if query.archived is not None:
            found = [course for course in found if course.archived == query.archived]
        if query.on is not None:
            found = [course for course in found if course.starts_on <= query.on <= course.ends_on]
        if query.robot is not None:
            robot = self.robot(query.robot)
            found = [course for course in found if robot in robots_of(course)]
        return CourseList([_entry(CourseEntry, course) for course in found])

    @makes(
        "courses_make",
        "Make a course",
        answer=CourseDetail,
        keyed=True,
        examples={
            "A term": {
                "name": "Robotics lab",
                "robots": ["tiago-1"],
                "starts_on": "2026-09-01",
                "ends_on": "2027-01-31",
            }
        },
    )
    def post(self, body: CourseRequest) -> Response:
        """For staff. Its people are enrolled at `/courses/{slug}/members`."""
        self.staff()
        course = Course(name=body.name, slug=free_slug(Course, body.name))
        self.save(course, body)
        return self.tagged(self.detail(course), 201, f"/api/v1/courses/{course.slug}")


class CourseView(CoursesBase):
    @manages("courses_read", "Read a course", answer=CourseDetail)
    def get(self, slug: str) -> Response:
        """Robots, dates, quotas, supervisors, and what its robots demand."""
        return self.tagged(self.detail(self.course(slug)))

    @edits(
        "courses_change", "Change a course, archive it or open it again", takes_time=True, answer=CourseDetail
    )
    def patch(self, slug: str, body: CourseChange) -> Response:
        """For staff. An archived course gives its people nothing."""
        staff = self.staff()
        with transaction.atomic():
            course = self.course(slug)
            list(Course.objects.select_for_update().filter(pk=course.pk))  # locked between check and save
            self.require_unchanged(self.detail(course))
            self.save(course, body)
            if isinstance(body.archived, bool):
                services.course_archive(course=course, archived=body.archived, actor=staff)
        return self.tagged(self.detail(self.course(slug)))


class MembersView(CoursesBase):
    @manages("members_list", "List a course’s people")
    def get(self, slug: str, query: MembersAsked) -> MemberList:
        """With the qualifications that they hold."""
        course = self.course(slug)
        held = grants_in(course, timezone.now())
        found = course.enrolments.select_related("person").order_by("person__full_name", "person__username")
        if query.q:
            fields = ("person__full_name", "person__username", "person__email")
            found = found.filter(reduce(or_, (Q(**{f"{field}__icontains": query.q}) for field in fields)))
        return MemberList(
            [
                Member(
                    username=one.person.username,
                    name=one.person.display_name,
                    email=one.person.email or "",
                    number=one.number,
                    since=one.added_at,
                    active=one.person.is_active,
                    qualifications=[
                        HeldQualification(grant.qualification.slug, grant.expires_at)
                        for grant in held.get(one.person_id, ())
                    ],
                )
                for one in found
            ]
        )

    @manages(
        "members_enrol",
        "Enrol people by a list",
        keyed=True,
        examples={"Two people": {"list": "Ada Lovelace <ada@example.org>\nAlan Turing, alan@example.org"}},
    )
    def post(self, slug: str, body: EnrolRequest) -> EnrolAnswer:
        """A repeated call changes nothing. Lines that cannot be used are left out and named."""
        course, people = self.course(slug), read_people(body.list)
        if body.preview:
            plan = enrolment.plan_of(people, course, self.person)
        else:
            site = public_origin(self.request._request)
            plan = enrolment.enrol_list(course=course, people=people, actor=self.person, site=site)
        return EnrolAnswer(
            enrolled=0 if body.preview else plan.to_enrol,
            known=[person.username for person in plan.known],
            new=[ListedPerson(one.name, one.email, one.number) for one in plan.new],
            undisclosed=[
                ListedPerson(one.listed.name, one.listed.email, one.listed.number) for one in plan.undisclosed
            ],
            already=[person.username for person in plan.enrolled],
            wrong=[WrongLine(one.line, one.text, one.reason) for one in plan.wrong],
            notes=list(plan.notes),
        )


class MemberView(CoursesBase):
    @manages("members_remove", "Take a person out of a course", takes_time=True)
    def delete(self, slug: str, username: str) -> None:
        """Ends the course’s role, and control by it."""
        course = self.course(slug)
        people = list(User.objects.filter(username=username.replace("\0", ""), enrolments__course=course))
        if not enrolment.unenrol(course=course, people=people, actor=self.person):
            raise Problem(_not_inside(username, course))


class GrantView(CoursesBase):
    @manages(
        "qualifications_grant", "Grant a qualification to people of a course", takes_time=True, keyed=True
    )
    def post(self, slug: str, qualification: str, body: GrantRequest) -> Changed:
        """Replaces an earlier grant."""
        found, people, last_day = self.chosen(slug, qualification, body.people, body.last_day)
        granted = services.qualification_grant(
            qualification=found, people=people, expires_at=end_of(last_day), actor=self.person
        )
        return Changed(granted)


class RevokeView(CoursesBase):
    @manages(
        "qualifications_revoke", "Revoke a qualification of people of a course", takes_time=True, keyed=True
    )
    def post(self, slug: str, qualification: str, body: PeopleRequest) -> Changed:
        """Ends their control of robots that demand it."""
        found, people, _ = self.chosen(slug, qualification, body.people)
        return Changed(services.qualification_revoke(qualification=found, people=people, actor=self.person))


def named(names: list[str], inside: QuerySet[User], course: Course) -> list[User]:
    """Return the people of a course with these user names. Raises `Problem`."""
    by_name = {one.username: one for one in inside}
    if unknown := [name for name in names if name not in by_name]:
        raise Problem(_not_inside(unknown[0], course))
    return [by_name[name] for name in names]


def _not_inside(username: str, course: Course) -> Refusal:
    return Refusal(
        "not_found", say("{username} is not in {name}.", username=username[:150], name=course.name), "wire"
    )


def _entry(kind: type[Entry], course: Course, /, **others: Any) -> Entry:
    valid = not course.archived and course.starts_on <= lab_date() <= course.ends_on
    return entry_of(kind, course, valid=valid, people=getattr(course, "people", 0), **others)
