"""One rule at all doors (`robots.access.who_sees`): the past with its names is for supervisors and staff.

The test walks every address that answers GET, and every WebSocket, as each member of a cast. A person who has left the
robot alone since leaves marks in the log, in bookings and in sessions. The tables say at which doors who reads them; a
new door that shows them is in no table, so the test fails.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import timedelta
from typing import Any
from uuid import UUID

import pytest
from django.test import AsyncClient, Client
from django.urls import URLPattern, get_resolver
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.audit.services import record
from fleet.bookings.messages.ical import address_make
from fleet.bookings.models import Booking, State
from fleet.bookings.services import record_booking
from fleet.site.websockets import websocket_urlpatterns
from robots.access.models import Course
from robots.access.selectors import lab_date
from robots.access.services import role_set
from robots.registry.models import Robot, RobotProfile, Role
from teleop.background.database import in_database
from teleop.models import ControlSession, EndReason
from tests.teleop.support import Page

NAME, USERNAME, WORDS = "Zora Quill", "zora.quill", "Violet rehearsal"
SERIES = UUID(int=41)  # of bookings: those to come name their person
TO_COME = "Pia Present"  # has a booking to come: the present, for all who see the robot
CAST = ("stranger", "observer", "operator", "teacher", "staff")
# Bound: of staff, for another robot
TOKENS = ("observer token", "teacher token", "staff token", "bound token")
READERS = {"teacher", "staff"}
PROGRAMS = {"teacher token", "staff token"}

# Each door at which somebody reads the marks, and who does.
PAST: dict[str, set[str]] = {
    "bookings/": READERS,
    "bookings/feed/": READERS,
    "bookings/<uuid:booking_id>/": READERS,
    "bookings/<uuid:booking_id>/lesson/": READERS,
    "bookings/ical/<str:token>.ics": READERS,
    "bookings/report/": READERS,
    "people/<uuid:person_id>/": {"staff"},
    "sessions/<uuid:session_id>/": READERS,
    "today/": READERS,
    "api/v1/events": READERS | PROGRAMS,
    "api/v1/robots/<slug:slug>/speech/history": READERS | PROGRAMS,
    "api/v1/bookings": READERS | PROGRAMS,
    "api/v1/bookings/<uuid:booking_id>": READERS | PROGRAMS,
    "api/v1/bookings/<uuid:booking_id>/lesson": READERS | PROGRAMS,
    "api/v1/sessions": READERS | PROGRAMS,
    "api/v1/sessions/<uuid:session_id>": READERS | PROGRAMS,
    "api/v1/robots/<slug:slug>/tasks/<int:number>": READERS | PROGRAMS,
    "api/v1/audit": {"staff", "staff token"},
    "api/v1/audit/<int:number>": {"staff", "staff token"},
}
STAFF_FOLDERS = ("admin/",)  # only staff get in: one other person tries
# The message with which each WebSocket begins; None: it carries what the robot sends, and no person.
SOCKETS: dict[str, str | None] = {
    "ws/fleet/": "fleet",
    "ws/bookings/": "bookings_changed",
    "ws/news/": "news",
    "ws/robots/<slug:slug>/": "control",
    "ws/robots/<slug:slug>/topics/": None,
    "ws/robots/<slug:slug>/camera/": None,
    "rosbridge/<slug:slug>": None,
    "rosbridge/<slug:slug>/": None,
    "foxglove/<slug:slug>": None,
    "foxglove/<slug:slug>/": None,
    "": None,  # every other address
}


class World:
    """A robot with a past, and the people who look at it."""

    def __init__(self, profile: RobotProfile) -> None:
        self.robot = Robot.objects.create(
            slug="tiago-1", name="TIAGo 1", profile=profile, master_uri="http://127.0.0.1:9"
        )
        self.other = Robot.objects.create(
            slug="other", name="Other", profile=profile, master_uri="http://127.0.0.1:8"
        )
        self.people = {who: User.objects.create_user(who, is_staff=who == "staff") for who in CAST}
        self.zora = User.objects.create_user(USERNAME, full_name=NAME)
        staff = self.people["staff"]
        for who in ("observer", "operator"):
            role_set(robot=self.robot, user=self.people[who], role=Role(who), actor=staff)
        today = lab_date()
        course = Course.objects.create(
            name="HRI", slug="hri", role=Role.OPERATOR, starts_on=today, ends_on=today + timedelta(days=9)
        )
        course.robots.add(self.robot)
        course.supervisors.add(self.people["teacher"])
        self.course = course
        self._past()
        pia = User.objects.create_user("pia", full_name=TO_COME)
        self._booking(pia, hours=30)
        self.feeds = {
            who: address_make(person=person, robot=self.robot, now=timezone.now())
            for who, person in self.people.items()
        }
        self.objects: dict[str, Any] = {
            "slug": self.robot.slug,
            "session_id": self.session.pk,
            "booking_id": self.booking.pk,
            "number": self.said.pk,
            "username": USERNAME,
            "person_id": self.zora.pk,
        }

    def _past(self) -> None:
        began = timezone.now() - timedelta(hours=5)
        self.session = ControlSession.objects.create(
            robot=self.robot,
            user=self.zora,
            fence=1,
            started_at=began,
            ended_at=began + timedelta(minutes=50),
            end_reason=EndReason.RELEASED,
        )
        self.booking = self._booking(self.zora, hours=-5)
        cancelled = self._booking(self.zora, hours=20, state=State.CANCELLED)
        for kind, booking in (("booking.make", self.booking), ("booking.cancel", cancelled)):
            record_booking(kind, booking, self.zora)
        facts: dict[str, Any] = {"robot_id": self.robot.id, "robot_name": self.robot.name}
        inside = {**facts, "session_id": self.session.pk, "fence": 1}
        record("control.take", actor=self.zora, **inside)
        spoken = {"language": "en-GB", "topic": "/tts"}
        self.said = record("speech.start", actor=self.zora, parameters=spoken, text=WORDS, **inside)
        record("speech.end", actor=self.zora, of=self.said, outcome="done", **inside)
        record("stop.latch", actor=self.zora, private={"reason": WORDS}, **inside)
        record("control.end", actor=self.zora, outcome="released", **inside)
        taken = {"holder": str(self.zora.pk)}
        record("control.take_over", actor=self.people["staff"], parameters=taken, **facts)

    def _booking(self, person: User, hours: float, state: str = State.BOOKED) -> Booking:
        starts = timezone.now() + timedelta(hours=hours)
        ends = starts + timedelta(hours=1)
        return Booking.objects.create(
            robot=self.robot,
            person=person,
            starts_at=starts,
            ends_at=ends,
            held_until=starts if state == State.CANCELLED else ends,
            used_at=starts if hours < 0 else None,
            made_at=starts - timedelta(days=1),
            state=state,
            course=self.course,
            purpose=WORDS if person == self.zora else "",
            series=SERIES if person == self.zora else None,
        )

    def signed_in(self, who: str) -> tuple[User, dict[str, str]]:
        """Return the person, and the headers of their token if they are a program."""
        name = who.split()[0]
        person = self.people["staff" if name == "bound" else name]
        if not who.endswith("token"):
            return person, {}
        _, text = token_make(
            user=person,
            name=who,
            scopes=list(Scope),
            expires_at=timezone.now() + timedelta(days=1),
            actor=person,
            robots=[self.other.id] if name == "bound" else [],
        )
        return person, {"Authorization": f"Bearer {text}"}

    def marks(self, text: str) -> set[str]:
        """Return the marks of the past in an answer."""
        return {mark for mark in (NAME, USERNAME, WORDS, str(SERIES), str(self.zora.pk)) if mark in text}


@pytest.fixture
def world(db: None, tiago: RobotProfile) -> World:
    return World(tiago)


def doors(resolver: Any = None, before: str = "") -> Iterator[str]:
    """Yield the route of each address of the console."""
    for one in (resolver or get_resolver()).url_patterns:
        route = before + (getattr(one.pattern, "_route", None) or one.pattern.regex.pattern.strip("^$"))
        if isinstance(one, URLPattern):
            yield route
        else:
            yield from doors(one, route)


def filled(route: str, objects: dict[str, Any]) -> str:
    """Return an address of a route."""

    def value(found: re.Match[str]) -> str:
        usual = UUID(int=1) if found[1] == "uuid" else 1
        return str(objects.get(found[2], usual))

    address = re.sub(r"<(?:([a-z]+):)?([a-z_0-9]+)>", value, route)
    return re.sub(r"\(\?P<.*?>.*?\)(?=/|-|$)", "1", address).replace("\\Z", "")


def asked(world: World) -> dict[str, str]:
    """Return the queries with which a door shows the past."""
    day = (timezone.now() - timedelta(hours=5)).astimezone(timezone.get_default_timezone()).date()
    return {
        "bookings/": f"?day={day}",
        "bookings/feed/": f"?start={day - timedelta(days=1)}&end={day + timedelta(days=3)}",
        "bookings/report/": f"?by=person&from={day}&to={day}",
        "today/": f"?day={day}",
        "api/v1/audit": f"?person={USERNAME}",
        "api/v1/sessions": f"?robot={world.robot.slug}",
    }


@pytest.mark.parametrize("who", [*CAST, *TOKENS])
def test_the_past_is_for_supervisors_and_staff(who: str, world: World) -> None:
    person, headers = world.signed_in(who)
    client = Client(headers=headers, raise_request_exception=False)
    objects, queries, found = dict(world.objects), asked(world), set[str]()
    if not headers:
        client.force_login(person)
        objects["token"] = world.feeds[who]
    for route in doors():
        if route == "api/v1/events" or (headers and not route.startswith("api/")):
            continue  # an answer that never ends: see below; a door that knows no tokens
        if route.startswith(STAFF_FOLDERS) and who != "operator":
            continue
        answer = client.get(f"/{filled(route, objects)}{queries.get(route, '')}")
        if world.marks(answer.getvalue().decode(errors="replace")):
            found.add(route)
    assert found == {route for route, readers in PAST.items() if who in readers} - {"api/v1/events"}


@pytest.mark.django_db(transaction=True)
async def test_events_of_others_come_without_names(world: World) -> None:
    found, told = set(), dict[str, set[str]]()
    for who in (*CAST, *TOKENS):
        person, headers = await in_database(world.signed_in, who)
        client = AsyncClient()
        if not headers:
            await client.aforce_login(person)
        answer: Any = await client.get("/api/v1/events?after=0", headers=headers)
        assert answer.status_code == 200, (who, answer.content)
        text, pieces = "", aiter(answer.streaming_content)
        with suppress(asyncio.TimeoutError):  # those who hear of no event wait in vain
            while "control.take_over" not in text:
                text += (await asyncio.wait_for(anext(pieces), 2.0)).decode()
        await pieces.aclose()
        told[who] = set(re.findall("event: (.*)", text))
        if world.marks(text):
            found.add(who)
    assert found == PAST["api/v1/events"]
    assert told["stranger"] == told["bound token"] == set()
    assert {"stop.latch", "control.take", "speech.end"} < told["observer"] == told["staff"]


@pytest.mark.django_db(transaction=True)
async def test_sockets_tell_no_past(world: World, websocket_headers: Callable[[Client], Any]) -> None:
    routes = [str(getattr(one.pattern, "_route", "")) for one in websocket_urlpatterns]
    assert set(routes) == set(SOCKETS)
    client = Client()
    await in_database(client.force_login, world.people["operator"])
    for route, first in SOCKETS.items():
        if first is None:
            continue
        page = await Page(websocket_headers(client), f"/{filled(route, world.objects)}").open()
        if "<slug:slug>" in route:
            await page.say("hello", tab="tab-0123456789-past")
        message = await page.hears(first)
        assert not world.marks(f"{message} {page.inbox}"), route
        await page.close()


def test_the_present_is_for_all_who_see_the_robot(world: World) -> None:
    client, day = Client(), (timezone.now() + timedelta(hours=30)).date()
    client.force_login(world.people["observer"])
    feed = f"/bookings/feed/?start={day - timedelta(days=1)}&end={day + timedelta(days=2)}"
    for address in (feed, "/api/v1/bookings", f"/bookings/ical/{world.feeds['observer']}.ics"):
        assert TO_COME in client.get(address).content.decode(), address


def test_a_refused_booking_names_nobody_of_the_past(world: World) -> None:
    client = Client()
    client.force_login(world.people["operator"])
    starts = timezone.now() - timedelta(hours=5)
    times = {"starts_at": starts.isoformat(), "ends_at": (timezone.now() + timedelta(hours=1)).isoformat()}
    answer = client.post("/api/v1/bookings", {"robot": "tiago-1", **times}, content_type="application/json")
    assert answer.status_code == 409
    assert not world.marks(answer.content.decode())
