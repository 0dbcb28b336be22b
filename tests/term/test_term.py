"""A teacher's whole term by pages only, without a mail server: as many actions as docs/teacher.md says."""

import csv
import io
import re
from datetime import timedelta
from pathlib import Path

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.test import Client
from django.utils import timezone

from fleet.bookings.models import Booking, State, Turn
from robots.access.models import Course
from tests.term.walker import Walker

pytestmark = pytest.mark.django_db
DOCS = Path(__file__).parents[2] / "docs"
ROW = re.compile(r"^\| [^|]+ \| (\d+) \| (?:no|\d[^|]*) \| (?:no|\d[^|]*) \|$", re.M)
REGISTRY = "Matrícula;Apellidos, Nombre;Correo\n" + "".join(
    f"u{n:03};Apellido{n}, Ana{n};ana{n}@example.org\n" for n in range(40)
)


def local(moment):
    return f"{moment:%Y-%m-%dT%H:%M}"


def lessons():
    return Booking.objects.filter(shared="course", state=State.BOOKED)


@pytest.fixture
def teacher(staff, robot, other_robot, signed_in):
    return Walker(signed_in(staff))


def test_a_term_takes_the_actions_that_the_docs_say(teacher, robot, other_robot, settings):
    settings.FLEET_EMAIL_URL = ""
    today = timezone.localdate()
    begin = (timezone.localtime() + timedelta(days=7)).replace(hour=10, minute=0, second=0, microsecond=0)

    teacher.task("list")
    teacher.open("Courses")
    teacher.open("New course")
    teacher.fill("Name", "HRI")
    teacher.fill("Last day", today + timedelta(days=90))
    teacher.tick(robot.name)
    teacher.tick(other_robot.name)
    teacher.fill("or a file", SimpleUploadedFile("registro.csv", REGISTRY.encode("cp1252")))
    teacher.press("Make the course")
    teacher.press("Make the course with 40 people")
    course = Course.objects.get()
    assert course.enrolments.count() == 40

    teacher.task("links")
    teacher.open("Courses")
    teacher.open("HRI")
    teacher.press("Links to set a password: 40 people")
    teacher.press_script("print")
    links = re.findall(r'slip-link">\S*?(/welcome/\S+?)<', teacher.text)
    assert len(links) == 40

    teacher.task("lessons")
    teacher.open("Courses")
    teacher.open("HRI")
    teacher.open("Lessons")
    teacher.fill("First slot from", local(begin))
    teacher.fill("First slot to", local(begin + timedelta(hours=2)))
    teacher.fill("Weeks", 3)
    teacher.fill("Minutes per turn", 5)
    teacher.press("Preview")
    teacher.press("Book the free ones")
    assert lessons().count() == 6

    student = a_student(links[0])
    assert "HRI" in student.go("/bookings/mine/").text

    teacher.task("turns")
    teacher.open("My bookings")
    teacher.open("Line of turns")
    teacher.press("Spread the students over 2 robots")
    assert [one.turns.count() for one in lessons().order_by("starts_at")[:2]] == [20, 20]

    teacher.task("ill")
    teacher.open("My bookings")
    teacher.open("Line of turns")
    teacher.press("Skip")
    assert Turn.objects.filter(state=Turn.State.SKIPPED).count() == 1

    teacher.task("holiday")
    teacher.open("Bookings")
    teacher.open("Policies")
    teacher.open("Holidays")
    teacher.fill("Name", "Fiesta")
    teacher.fill("First day", (begin + timedelta(weeks=1)).date())
    teacher.press("Add")
    teacher.press("Do it")
    assert lessons().count() == 4

    teacher.task("out of service")
    teacher.open("Bookings")
    teacher.open("Policies")
    teacher.fill("Robot or group", other_robot.slug)
    teacher.press("Take out of service")
    teacher.press("Do it")

    teacher.task("exam")
    teacher.open("Courses")
    teacher.open("Qualifications")
    teacher.fill("Name", "Examen")
    teacher.tick(robot.name)
    teacher.tick(other_robot.name)
    teacher.press("Save")
    teacher.open("Courses")
    teacher.open("HRI")
    teacher.tick("Everybody in the course")
    teacher.press("Grant")

    teacher.task("marks")
    teacher.open("Courses")
    teacher.open("HRI")
    teacher.open("Marks (CSV)")
    rows = list(csv.reader(io.StringIO(teacher.answer.content.decode("utf-8-sig"))))
    assert len(rows) == 41

    teacher.task("archive")
    teacher.open("Courses")
    teacher.press("Archive")
    teacher.press("Do it")
    assert lessons().count() == 0

    teacher.task("open again")
    teacher.open("Courses")
    teacher.press("Open again")
    assert lessons().count() == 4

    for guide in ("teacher.md", "es/teacher.md"):
        told = [int(actions) for actions in ROW.findall((DOCS / guide).read_text())]
        assert told == list(teacher.actions.values())


def a_student(link):
    student = Walker(Client())
    student.task("password", link)
    student.fill("Password", "a long walk by the river")
    student.fill("The password again", "a long walk by the river")
    student.press("Set the password")
    return student
