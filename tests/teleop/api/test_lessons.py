"""Lessons and teams by REST and by pages: make them, see them, and use their line."""

import re
from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone as clock

from fleet.accounts.services import account_erase
from fleet.bookings.lessons import turns
from fleet.bookings.messages.ical import address_make, feed_of
from fleet.bookings.models import Booking, HandOffer
from robots.access.models import Course, Enrolment, Qualification
from robots.registry.models import Phrase

HTML = {"headers": {"Accept": "text/html"}}

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def course(robot, supervisor, stranger, second_operator):
    """A course of `supervisor`; `stranger` and `second_operator` are in it."""
    today = clock.now().date()
    days = {"starts_on": today - timedelta(days=2), "ends_on": today + timedelta(days=30)}
    made = Course.objects.create(name="HRI 2026", slug="hri", role="operator", **days)
    made.robots.add(robot)
    made.supervisors.add(supervisor)
    for person in (stranger, second_operator):
        Enrolment.objects.create(course=made, person=person)
    return made


@pytest.fixture
def lesson(course, robot, supervisor, program):
    """A lesson that runs now, with turns of ten minutes."""
    starts = clock.now() - timedelta(seconds=20)
    slot = {"starts_at": starts.isoformat(), "ends_at": (starts + timedelta(hours=1)).isoformat()}
    made = program(supervisor, "read", "book")(
        "POST",
        "/bookings",
        {"robot": robot.slug, **slot, "lesson_of": "hri", "turn_min": 10, "purpose": "SLAM"},
    )
    assert made.status_code == 201, made.data
    assert (made.data["shared"], made.data["lesson"], made.data["turn_min"]) == ("course", "HRI 2026", 10)
    return made.data["id"]


def test_a_line_by_programs(lesson, program, stranger, second_operator, supervisor, operator):
    address = f"/bookings/{lesson}/lesson"
    student, other, teacher = (
        program(person, "read", "book") for person in (stranger, second_operator, supervisor)
    )
    joined = student("POST", f"{address}/line", None).data
    assert [(one["person"], one["state"], one["yours"]) for one in joined["line"]] == [
        ("Stig Stranger", "called", True)
    ]
    mine = other("POST", f"{address}/line", None).data["line"][1]
    assert (mine["state"], mine["place"], mine["begins_in_min"]) == ("waiting", 1, 10)
    refused = other("POST", f"{address}/hold", None)
    assert (refused.status_code, refused.data["code"]) == (403, "not_teacher")
    held = teacher("POST", f"{address}/hold", None).data
    assert held["held"]
    assert [one["state"] for one in held["line"]] == ["waiting", "waiting"]
    called = teacher("POST", f"{address}/call", {"username": "second"}).data
    assert [(one["username"], one["state"]) for one in called["line"]] == [
        ("second", "called"),
        ("stranger", "waiting"),
    ]
    turn = called["line"][0]["id"]
    assert teacher("POST", f"{address}/turns/{turn}", {"minutes": 5}).status_code == 200
    assert teacher("DELETE", f"{address}/turns/{turn}").data["line"][0]["username"] == "stranger"
    assert teacher("DELETE", f"{address}/turns/{turn}").data["code"] == "no_such_turn"
    assert student("DELETE", f"{address}/line").data["line"] == []
    assert len(teacher("POST", f"{address}/everybody", None).data["line"]) == 0  # all had a turn
    assert program(operator, "read", "book")("GET", address).data["code"] == "not_in_lesson"


def test_tasks_of_a_lesson_by_a_program_and_by_the_page(
    lesson, program, stranger, supervisor, signed_in, robot
):
    address = f"/bookings/{lesson}/lesson"
    teacher = program(supervisor, "read", "book")
    tasks = {
        "max_share": 0.4,
        "motions": ["wave"],
        "phrases": [],
        "places": [],
        "watch": False,
        "without": [],
    }
    answer = teacher("PUT", f"{address}/tasks", {"max_share": 0.4, "motions": ["wave"]}).data
    assert (answer["tasks"], answer["at_once"]) == (tasks, [lesson])
    refused = teacher("PUT", f"{address}/tasks", {"max_share": 1.5})
    assert refused.status_code == 400
    student = program(stranger, "read", "book")
    assert student("PUT", f"{address}/tasks", {}).data["code"] == "not_teacher"
    assert student("GET", address).data["tasks"] == tasks
    page = signed_in(stranger).get(f"{address}/").content.decode()
    assert "up to 40 % of the speed" in page
    assert "Largest speed" not in page
    Phrase.objects.create(robot=robot, text="Hello.", language="en-GB")
    teachers = signed_in(supervisor)
    assert 'value="wave" checked' in teachers.get(f"{address}/").content.decode()
    shown = teachers.get(f"{address}/").content.decode()
    assert "drives to a place keep the speed of the robot’s own navigation" in re.sub(r"\s+", " ", shown)
    sent = {"action": "tasks", "share": "60", "phrases": ["Hello."], "watch": "yes", "without": ["places"]}
    teachers.post(f"{address}/", sent)
    chosen = teacher("GET", address).data["tasks"]
    assert chosen == tasks | {
        "max_share": 0.6,
        "motions": [],
        "phrases": ["Hello."],
        "watch": True,
        "without": ["places"],
    }
    assert 'value="places" checked' in teachers.get(f"{address}/").content.decode()
    assert teacher("PUT", f"{address}/tasks", {"without": ["speed"]}).status_code == 400
    assert teachers.post(f"{address}/", {"action": "tasks", "share": "900"}).status_code == 404


def test_who_shares_a_lesson_sees_it_as_theirs(lesson, program, stranger, operator, signed_in):
    [entry] = program(stranger, "read", "book")("GET", "/bookings?person=me").data["bookings"]
    assert (entry["shared_with_you"], entry["yours"], entry["may_change"]) == (True, False, False)
    assert program(operator, "read", "book")("GET", "/bookings?person=me").data["bookings"] == []
    browser = signed_in(stranger)
    mine = browser.get("/bookings/mine/").content.decode()
    assert "HRI 2026" in mine
    assert f"/bookings/{lesson}/lesson/" in mine
    day = clock.localtime().date()
    span = f"start={day - timedelta(days=1)}&end={day + timedelta(days=2)}"
    for person, kind in ((stranger, "mine"), (operator, "other")):
        [event] = [
            one
            for one in signed_in(person).get(f"/bookings/feed/?{span}").json()["events"]
            if one["id"] == lesson
        ]
        assert (event["title"], event["classNames"][0]) == ("HRI 2026", kind)
        assert "editable" not in event
    token = address_make(person=stranger, robot=None, now=clock.now())
    assert b"SUMMARY:TIAGo 1: HRI 2026" in feed_of(token, clock.now())


def test_the_page_of_a_line(lesson, signed_in, stranger, supervisor, operator, second_operator):
    address = f"/bookings/{lesson}/lesson/"
    student, teacher = signed_in(stranger), signed_in(supervisor)
    assert "Join the line" in student.get(address).content.decode()
    student.post(address, {"action": "join"})
    page = student.get(address).content.decode()
    assert "Your turn: TIAGo 1" in page
    assert "Put everybody" not in page
    assert student.post(address, {"action": "hold"}).status_code == 409
    assert student.post(address, {"action": "nonsense"}).status_code == 404
    teacher.post(address, {"action": "fill"})
    demanded = Qualification.objects.create(name="Induction", slug="induction")
    demanded.robots.add(Booking.objects.get().robot)
    lacks = "2 people may not drive this robot, and are not called. Missing: Induction."
    assert lacks in teacher.get(address).text and lacks not in student.get(address).text
    demanded.delete()
    turn = Booking.objects.get().turns.get(person=second_operator)
    assert teacher.post(address, {"action": "extend", "turn": turn.pk}).status_code == 302
    turn.refresh_from_db()
    assert turn.left_s == 12 * 60
    teacher.post(address, {"action": "skip", "turn": Booking.objects.get().turns.get(person=stranger).pk})
    turn.refresh_from_db()
    assert turn.state == "called"
    teacher.post(address, {"action": "hold"})
    assert "The teacher drives" in teacher.get(address).content.decode()
    teacher.post(address, {"action": "go_on"})
    assert signed_in(operator).get(address).status_code == 403


def test_a_team_by_the_form(robot, operator, second_operator, signed_in):
    starts = clock.localtime() + timedelta(hours=1)
    typed = {
        "robot": robot.slug,
        "starts_at": f"{starts:%Y-%m-%dT%H:%M}",
        "ends_at": f"{starts + timedelta(hours=1):%Y-%m-%dT%H:%M}",
        "team": "second, nobody",
        "turn_min": "",
    }
    refused = signed_in(operator).post("/bookings/new/", typed, **HTML)
    assert refused.status_code == 409
    assert "Nobody with the user name nobody" in refused.content.decode()
    assert signed_in(operator).post("/bookings/new/", typed | {"team": "second"}, **HTML).status_code == 302
    booking = Booking.objects.get()
    assert (booking.shared, booking.members.count()) == ("people", 0)  # she is asked first
    offer = HandOffer.objects.get()
    signed_in(second_operator).post(reverse("hand-answer", args=[offer.pk]), {"answer": "accept"}, **HTML)
    assert booking.members.get().person == second_operator
    page = signed_in(second_operator).get("/bookings/mine/").content.decode()
    assert "with Olga Operator" in page


def test_a_teacher_chooses_for_the_course_in_the_form(course, robot, supervisor, operator, signed_in):
    assert "For the course" in signed_in(supervisor).get("/bookings/new/").content.decode()
    assert "For the course" not in signed_in(operator).get("/bookings/new/").content.decode()
    starts = clock.localtime() + timedelta(hours=1)
    typed = {
        "robot": robot.slug,
        "starts_at": f"{starts:%Y-%m-%dT%H:%M}",
        "ends_at": f"{starts + timedelta(hours=1):%Y-%m-%dT%H:%M}",
        "lesson_of": "hri",
        "turn_min": "10",
    }
    assert signed_in(supervisor).post("/bookings/new/", typed, **HTML).status_code == 302
    booking = Booking.objects.get()
    assert (booking.shared, booking.course, booking.turn_min) == ("course", course, 10)


def test_an_erased_person_leaves_lines_and_teams(lesson, stranger, staff):
    turns.turn_join(booking_id=lesson, person=stranger, now=clock.now())
    account_erase(user=stranger, actor=staff)
    assert not Booking.objects.get().turns.exists()
