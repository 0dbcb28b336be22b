"""A person's own device: the link of their course signs them in there, without the password."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.access.enrolment import enrol, invitation_make
from robots.access.models import Course
from robots.registry.models import Robot
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db


@pytest.fixture
def course(robot: Robot, operator: User, staff: User) -> Course:
    made = Course.objects.create(name="HRI", slug="hri", starts_on=date(2026, 1, 1), ends_on=date(2099, 1, 1))
    made.robots.add(robot)
    enrol(course=made, people=[operator], actor=staff)
    return made


@pytest.fixture
def link(course: Course, staff: User) -> str:
    made = invitation_make(
        course=course, expires_at=timezone.now() + timedelta(days=1), most_uses=40, actor=staff
    )
    return f"/join/{made.code}/"


def device_of(person: User, *, own: bool = True) -> Client:
    """Return the browser in which the person signed in, chose this, and signed out again."""
    browser = Client()
    chosen = {"own_device": "1"} if own else {}
    form = {"username": person.username, "password": PASSWORD, **chosen}
    assert browser.post("/accounts/sign-in/", form).status_code == 302
    browser.post("/accounts/sign-out/")
    return browser


def test_the_courses_link_signs_in_on_the_own_device(link: str, operator: User) -> None:
    device = device_of(operator)
    assert "Go on as Olga Operator" in device.get(link).text
    assert device.post(link, {"device": "1"}).headers["Location"] == "/"
    assert device.get("/").context["user"] == operator
    signed_in = Record.objects.filter(kind="account.sign_in").order_by("-pk").first()
    assert signed_in is not None
    assert signed_in.parameters == {"by": ["known_device"]}


def test_no_other_device_person_or_link_signs_in(
    link: str, course: Course, operator: User, second_operator: User, staff: User
) -> None:
    for device in (Client(), device_of(operator, own=False), device_of(second_operator), device_of(staff)):
        assert "Go on as" not in device.get(link).text
        device.post(link, {"device": "1"})
        assert (
            not device.get("/accounts/").context
            or not device.get("/accounts/").context["user"].is_authenticated
        )
    forged = Client()
    forged.cookies.load(device_of(operator).cookies.output(header=""))
    for name, cookie in forged.cookies.items():
        if "device" in name:
            forged.cookies[name] = cookie.value[:-1] + ("a" if cookie.value[-1] != "a" else "b")
    assert "Go on as" not in forged.get(link).text


def test_it_ends_with_the_password_the_course_and_the_account(
    link: str, course: Course, operator: User
) -> None:
    device = device_of(operator)
    course.enrolments.all().delete()
    assert "Go on as" not in device.get(link).text
    enrol(course=course, people=[operator], actor=None)
    assert "Go on as" in device.get(link).text
    User.objects.filter(pk=operator.pk).update(is_active=False)
    assert "Go on as" not in device.get(link).text
    User.objects.filter(pk=operator.pk).update(is_active=True)
    operator.set_password("another one, and longer")
    operator.save()
    assert "Go on as" not in device.get(link).text
