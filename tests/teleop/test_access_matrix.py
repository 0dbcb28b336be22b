"""Permissions at all interfaces: role x action x (own, of the person's course, another's, nobody's).

Tables give each person's role on each robot, and the lowest role that may do each action.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.test import Client
from django.urls import NoReverseMatch, reverse
from django.utils import timezone

from fleet.accounts.models import User
from fleet.bookings.models import Booking
from robots.access.enrolment import invitation_make
from robots.access.models import Course, Enrolment
from robots.access.selectors import lab_date, role_on
from robots.access.services import role_set
from robots.registry.models import Robot, RobotProfile, Role
from teleop.background.database import in_database
from teleop.live.consumers.message_socket import CloseCode
from tests.teleop.api.test_matrix import undone
from tests.teleop.support import Page

ROBOTS = ("own", "course", "other-course", "nobodys")
# The role of each person on each robot; a robot that is left out: no role.
ROLES: dict[str, dict[str, Role]] = {
    "staff": dict.fromkeys(ROBOTS, Role.STAFF),
    "supervisor": {"own": Role.SUPERVISOR},
    "operator": {"own": Role.OPERATOR},
    "observer": {"own": Role.OBSERVER},
    "teacher": {"course": Role.SUPERVISOR},
    "student": {"course": Role.OPERATOR},
    "guest": {"course": Role.OBSERVER},  # of a second course on the same robot
    "former": {},  # of a course that is over
    "stranger": {},
    "anonymous": {},
}


class Lab:
    """Robots, people and courses of the matrix."""

    def __init__(self, profile: RobotProfile) -> None:
        self.robots = {
            name: Robot.objects.create(slug=name, name=name, profile=profile, master_uri="http://127.0.0.1:9")
            for name in ROBOTS
        }
        self.people = {
            name: User.objects.create_user(name, is_staff=name == "staff")
            for name in ROLES
            if name != "anonymous"
        }
        for name in ("supervisor", "operator", "observer"):
            robot, user = self.robots["own"], self.people[name]
            role_set(robot=robot, user=user, role=Role(name), actor=self.people["staff"])
        today = lab_date()
        self.courses = {
            "mine": self._course("mine", "course", Role.OPERATOR, ["student"], ["teacher"]),
            "guests": self._course("guests", "course", Role.OBSERVER, ["guest"], []),
            "theirs": self._course("theirs", "other-course", Role.OPERATOR, [], []),
            "over": self._course("over", "course", Role.OPERATOR, ["former"], ["former"]),
        }
        over = Course.objects.filter(slug="over")
        over.update(starts_on=today - timedelta(days=9), ends_on=today - timedelta(days=1))
        self._browsers: dict[str, Client] = {}

    def _course(self, slug: str, robot: str, role: Role, people: list[str], supervisors: list[str]) -> Course:
        first, last = lab_date(), lab_date() + timedelta(days=30)
        course = Course.objects.create(name=slug, slug=slug, role=role, starts_on=first, ends_on=last)
        course.robots.add(self.robots[robot])
        course.supervisors.set([self.people[name] for name in supervisors])
        for name in people:
            Enrolment.objects.create(course=course, person=self.people[name])
        return course

    def browser(self, who: str) -> Client:
        """Return the browser in which the person is signed in."""
        if who not in self._browsers:
            client = self._browsers[who] = Client()
            if who != "anonymous":
                client.force_login(self.people[who])
        return self._browsers[who]


@pytest.fixture
def lab(tiago: RobotProfile) -> Lab:
    return Lab(tiago)


def test_the_roles_of_the_matrix(lab: Lab) -> None:
    for who, person in lab.people.items():
        found = {name: role_on(person, robot) for name, robot in lab.robots.items()}
        assert {name: role for name, role in found.items() if role} == ROLES[who], who


# --- robots: pages, admin -------------------------------------------------------------------

Ask = Callable[[Client, Robot], Any]


def _book(client: Client, robot: Robot) -> Any:
    starts = (timezone.now() + timedelta(days=1)).replace(hour=10, minute=0)
    times = {"starts_at": f"{starts:%Y-%m-%dT%H:%M}", "ends_at": f"{starts:%Y-%m-%dT11:00}"}
    accept = {"accept": "application/json"}
    return client.post("/bookings/new/", {"robot": robot.slug, **times}, headers=accept)


# Action: the lowest role that may do it, its request.
ROBOT_ACTIONS: dict[str, tuple[Role, Ask]] = {
    "page": (Role.OBSERVER, lambda client, robot: client.get(f"/robots/{robot.slug}/")),
    "report": (Role.SUPERVISOR, lambda client, robot: client.get(f"/robots/{robot.slug}/report/")),
    "book": (Role.OPERATOR, _book),
    "policy": (Role.SUPERVISOR, lambda client, robot: client.get(f"/bookings/policies/{robot.slug}/")),
    "policy of all": (Role.STAFF, lambda client, _robot: client.get("/bookings/policies/all/")),
    "admin": (Role.STAFF, lambda client, robot: client.get(f"/admin/robots/robot/{robot.pk}/change/")),
}


def test_robots_by_pages_and_admin(lab: Lab) -> None:
    """`tests/teleop/api/test_matrix.py` has REST."""
    for who, roles in ROLES.items():
        client = lab.browser(who)
        for name, robot in lab.robots.items():
            for action, (least, ask) in ROBOT_ACTIONS.items():
                role = roles.get(name)
                allowed = role is not None and role >= least
                if action == "policy of all":
                    allowed = who == "staff"
                if action == "policy" and who == "teacher":
                    allowed = False  # the course's robot serves other courses, too
                with undone():
                    status = ask(client, robot).status_code
                assert (status == 200) is allowed, (who, action, name, status)
                assert status in (200, 302, 400, 401, 403, 404, 409), (who, action, name, status)
                if who == "anonymous":
                    assert status in (302, 401, 403)


# Owner, robot and course of a booking, and the people who may change it, besides staff.
BOOKINGS: dict[tuple[str, str, str], set[str]] = {
    ("operator", "own", ""): {"operator", "supervisor"},
    ("student", "course", "mine"): {"student", "teacher"},
    ("guest", "course", "guests"): {"guest"},
    ("teacher", "course", ""): {"teacher"},
    ("staff", "nobodys", ""): set(),
}


@pytest.mark.parametrize(("owner", "robot", "course"), BOOKINGS)
def test_bookings_of_others(owner: str, robot: str, course: str, lab: Lab) -> None:
    starts = timezone.now() + timedelta(days=1)
    booking = Booking.objects.create(
        robot=lab.robots[robot],
        person=lab.people[owner],
        course=lab.courses.get(course),
        starts_at=starts,
        ends_at=starts + timedelta(hours=1),
        held_until=starts + timedelta(hours=1),
        made_at=timezone.now(),
    )
    for who, roles in ROLES.items():
        fields = {"action": "cancel", "version": str(booking.version)}
        client = lab.browser(who)
        accept = {"accept": "application/json"}
        feed = client.get(f"/bookings/feed/?start={starts:%Y-%m-%d}&end=2100-01-01", headers=accept)
        answer = client.post(f"/bookings/{booking.pk}/", fields, headers=accept)
        allowed = who == "staff" or who in BOOKINGS[owner, robot, course]
        assert (answer.status_code == 200) is allowed, (who, answer.status_code)
        if robot not in roles:
            assert answer.status_code in (302, 401, 404), who
        else:
            [event] = [one for one in feed.json()["events"] if one["id"] == str(booking.pk)]
            assert event.get("editable", False) is allowed, who
        Booking.objects.filter(pk=booking.pk).update(
            state="booked", held_until=booking.ends_at, version=booking.version
        )


@pytest.mark.parametrize(("owner", "robot", "course"), BOOKINGS)
def test_who_may_approve(owner: str, robot: str, course: str, lab: Lab) -> None:
    """Nobody approves their own booking, unless they supervise the robot or the course."""
    starts = timezone.now() + timedelta(days=1)
    times = {"starts_at": starts, "ends_at": starts + timedelta(hours=1)}
    for who in ROLES:
        booking = Booking.objects.create(
            robot=lab.robots[robot],
            person=lab.people[owner],
            course=lab.courses.get(course),
            **times,
            held_until=times["ends_at"],
            made_at=timezone.now(),
            state="awaiting",
        )
        fields = {"action": "approve", "version": "1"}
        lab.browser(who).post(f"/bookings/{booking.pk}/", fields, headers={"accept": "application/json"})
        booking.refresh_from_db()
        allowed = who == "staff" or who in BOOKINGS[owner, robot, course] & {"supervisor", "teacher"}
        if (owner, course) == ("teacher", ""):  # their own booking without a course
            allowed = who == "staff"
        assert (booking.state == "booked") is allowed, who
        booking.delete()


# Each page, and the people who see it: it shows the robots and courses that they supervise.
STAFF_PAGES = {
    "/today/": {"staff", "supervisor", "teacher"},
    "/bookings/report/": {"staff", "supervisor", "teacher", "former"},  # of a course that is over, too
    "/bookings/series/": {"staff", "supervisor", "teacher"},
    "/bookings/policies/": {"staff", "supervisor"},
}


@pytest.mark.parametrize("page", STAFF_PAGES)
def test_pages_of_supervisors(page: str, lab: Lab) -> None:
    seen = {who for who in ROLES if lab.browser(who).get(page).status_code == 200}
    assert seen == STAFF_PAGES[page]


def test_who_may_book_for_whom(lab: Lab) -> None:
    starts = (timezone.now() + timedelta(days=1)).replace(hour=10, minute=0)
    times = {"starts_at": f"{starts:%Y-%m-%dT%H:%M}", "ends_at": f"{starts:%Y-%m-%dT11:00}"}
    accept = {"accept": "application/json"}
    for who, owner, robot, allowed in (
        ("staff", "student", "course", True),
        ("teacher", "student", "course", True),
        ("teacher", "staff", "course", False),
        ("supervisor", "operator", "own", True),
        ("student", "teacher", "course", False),
    ):
        fields = {"robot": robot, "person": owner, **times}
        lab.browser(who).post("/bookings/new/", fields, headers=accept)
        made = Booking.objects.filter(person=lab.people[owner], robot=lab.robots[robot])
        assert made.exists() is allowed, (who, owner)
        Booking.objects.all().delete()


@pytest.mark.parametrize("who", ROLES)
def test_lists_of_robots_show_those_with_a_role(who: str, lab: Lab) -> None:
    page = lab.browser(who).get("/")
    for name in ROBOTS:
        assert (f'href="/robots/{name}/"' in page.content.decode()) is (name in ROLES[who]), name


# --- robots: WebSocket ----------------------------------------------------------------------------


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize("who", [who for who in ROLES if who != "anonymous"])
async def test_robots_by_websocket(
    who: str, tiago: RobotProfile, websocket_headers: Callable[[Client], Any]
) -> None:
    lab = await in_database(Lab, tiago)
    headers = websocket_headers(await in_database(lab.browser, who))
    for name in ROBOTS:
        page = await Page(headers, f"/ws/robots/{name}/").open()
        role = ROLES[who].get(name)
        if role is None:
            assert await page.is_closed() == CloseCode.NOT_FOUND
            continue
        await page.say("hello", tab="tab-0123456789-matrix")
        assert (await page.hears("welcome"))["role"] == role.value
        refusal = (await page.hears("control"))["refusal"]
        too_low = refusal is not None and refusal["code"] == "role_too_low"
        assert too_low is (role < Role.OPERATOR), (name, refusal)
        await page.close()


# --- courses --------------------------------------------------------------------------------------

# Page: the lowest role that may ("supervisor" of the course, or "staff"), and the posted form.
COURSE_ACTIONS: dict[str, tuple[str, dict[str, str] | None]] = {
    "course": ("supervisor", None),
    "course-enrol": ("supervisor", None),
    "course-people": ("supervisor", {"action": "unenrol", "everybody": "on"}),
    "invitation-new": ("supervisor", {"most_uses": "1", "last_day": "tomorrow"}),
    "invitation": ("supervisor", None),
    "invitation-qr": ("supervisor", None),
    "invitation-revoke": ("supervisor", {}),
    "bookings-course": ("supervisor", None),
    "course-edit": ("staff", None),
    "course-archive": ("staff", {"archived": "1"}),
    "course-new": ("staff", None),
    "robot-groups": ("staff", None),
    "qualifications": ("staff", None),
    "service-accounts": ("staff", None),
    "webhooks": ("staff", None),
    "webhook-new": ("staff", None),
}
SUPERVISED = {"teacher": {"mine"}, "former": {"over"}}


def test_courses(lab: Lab) -> None:
    tomorrow = lab_date() + timedelta(days=1)
    for slug, course in lab.courses.items():
        expires_at, staff = timezone.now() + timedelta(days=1), lab.people["staff"]
        invitation = invitation_make(course=course, expires_at=expires_at, most_uses=1, actor=staff)
        for action, (least, posted) in COURSE_ACTIONS.items():
            address = _address(action, slug, invitation.pk)
            if slug not in ("mine", *address.split("/")):
                continue  # the same address for all courses
            data = posted and {
                name: tomorrow.isoformat() if value == "tomorrow" else value for name, value in posted.items()
            }
            for who in ROLES:
                client = lab.browser(who)
                with undone():
                    answer = client.get(address) if posted is None else client.post(address, data)
                supervises = least == "supervisor" and slug in SUPERVISED.get(who, ())
                allowed = who == "staff" or supervises
                done = answer.status_code == 200 or getattr(answer, "url", "").startswith("/courses/")
                assert done is allowed, (who, action, slug, answer.status_code)
                if who == "anonymous":
                    assert answer.status_code in (302, 401)


def _address(action: str, slug: str, invitation: Any) -> str:
    for arguments in ([slug, invitation], [slug], []):
        try:
            return reverse(action, args=arguments)
        except NoReverseMatch:
            continue
    raise AssertionError(action)


def test_a_persons_access_is_shown_to_staff_and_supervisors(lab: Lab) -> None:
    seen = {
        who: {
            name
            for name, person in lab.people.items()
            if lab.browser(who).get(f"/people/{person.pk}/").status_code == 200
        }
        for who in ROLES
    }
    assert seen.pop("staff") == set(lab.people)
    assert seen.pop("anonymous") == set()
    assert seen.pop("teacher") == {"teacher", "student"}
    assert seen == {who: {who} for who in seen}
