"""Many people or robots at once: export, erase, copy."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from asgiref.sync import async_to_sync
from django.test import Client
from django.utils import timezone

from fleet.accounts.erasing import AGAIN, WAIT, erase_next, erasures_ask
from fleet.accounts.models import Erasure, User
from fleet.audit.models import Record
from fleet.audit.services import record
from fleet.bookings.models import Booking, State
from robots.access.models import Course, Enrolment
from robots.registry.models import Robot

pytestmark = pytest.mark.django_db

SignIn = Callable[[User], Client]
PEOPLE, ROBOTS = "/admin/accounts/user/", "/admin/robots/robot/"


@pytest.fixture
def course(operator: User, observer: User) -> Course:
    today = timezone.localdate()
    made = Course.objects.create(name="HRI", slug="hri", starts_on=today, ends_on=today)
    for number, person in enumerate((operator, observer)):
        Enrolment.objects.create(course=made, person=person, number=str(number))
    return made


def test_people_are_erased_after_a_look_at_their_bookings(
    signed_in: SignIn, staff: User, operator: User, observer: User, robot: Robot
) -> None:
    starts = timezone.now() + timedelta(days=1)
    slot = {"starts_at": starts, "ends_at": starts + timedelta(hours=1)}
    booking = Booking.objects.create(
        robot=robot, person=operator, held_until=slot["ends_at"], made_at=timezone.now(), **slot
    )
    client, chosen = signed_in(staff), [str(operator.pk), str(observer.pk), str(staff.pk)]
    ask = client.post(PEOPLE, {"action": "erase_people", "_selected_action": chosen})
    named = re.findall(r'name="person" value="([^"]+)"', ask.text)
    assert set(named) == set(chosen[:2])  # nobody erases themselves
    sure = {"person": named, "sure": "1"}
    preview = client.post("/people/erase/", sure)
    assert preview.status_code == 409 and operator.display_name in preview.text
    assert User.objects.get(pk=operator.pk).is_active
    digest = re.search(r'name="losses_seen" value="(\w+)"', preview.text)[1]
    assert client.post("/people/erase/", {**sure, "losses_seen": digest}).status_code == 302
    assert not User.objects.filter(pk__in=chosen[:2], is_active=True).exists()
    booking.refresh_from_db()
    assert booking.state == State.CANCELLED
    assert not erase_next(timezone.now())  # records under way may still name them
    later = timezone.now() + WAIT
    assert [erase_next(later) for _ in range(3)] == [True, True, False]
    assert User.objects.filter(username__startswith="erased-").count() == 2
    erased = Record.objects.filter(kind="audit.erase")
    assert {one.actor_id for one in erased} == {str(staff.pk)}


def test_erasing_leads_back_to_the_list_on_which_people_were_chosen(
    signed_in: SignIn, staff: User, course: Course, operator: User
) -> None:
    client, chosen = signed_in(staff), {"person": str(operator.pk)}
    assert f'href="{PEOPLE}"' in client.post("/people/erase/", chosen).text
    asked = client.post("/people/erase/", {**chosen, "course": "hri"})
    assert 'href="/courses/hri/">Back' in asked.text and 'name="course" value="hri"' in asked.text
    done = client.post("/people/erase/", {**chosen, "course": "hri", "sure": "1"})
    assert done["Location"] == "/courses/hri/"


@pytest.mark.parametrize("claimed", [False, True])
def test_an_account_that_is_opened_again_is_not_erased(
    claimed: bool, signed_in: SignIn, staff: User, operator: User
) -> None:
    erasures_ask(people=[operator], actor=staff, now=timezone.now())
    if claimed:  # too late: a process erases the person now
        Erasure.objects.update(claimed_at=timezone.now())
    User.objects.get(pk=operator.pk).save(update_fields=["full_name"])
    assert Erasure.objects.exists()
    opened = {"username": "operator", "full_name": "Olga", "email": "", "is_active": "on"}
    page = signed_in(staff).post(f"{PEOPLE}{operator.pk}/change/", opened, follow=True)
    assert ("is not erased" in page.text) is not claimed
    later = timezone.now() + WAIT + AGAIN
    assert erase_next(later) is claimed
    operator.refresh_from_db()
    assert (operator.username == "operator", operator.is_active) == (not claimed, not claimed)


def content(answer: Any) -> str:
    async def read() -> bytes:
        return b"".join([piece async for piece in answer.streaming_content])

    return async_to_sync(read)().decode()


def test_the_data_of_many_people_are_one_file(
    signed_in: SignIn, staff: User, supervisor: User, operator: User, course: Course
) -> None:
    record("speech.start", actor=operator, text="Hello", parameters={"language": "en-GB"})
    client, everybody = signed_in(staff), {"everybody": "on", "course": "hri"}
    answer = client.post("/people/export/", everybody)
    lines = [json.loads(line) for line in content(answer).splitlines()]
    assert [line["username"] for line in lines if "account" in line] == ["observer", "operator"]
    assert [line for line in lines if line.get("kind") == "speech.start"]
    begun = Record.objects.get(kind="audit.export", of=None)
    assert len(begun.parameters["people"]) == 2
    chosen = {"action": "export_people", "_selected_action": [str(operator.pk)]}
    assert "operator" in content(client.post(PEOPLE, chosen))
    for address in ("/people/export/", "/people/erase/"):
        assert signed_in(supervisor).post(address, everybody).status_code == 403


def test_people_are_copied_into_another_course_with_their_numbers(
    signed_in: SignIn, supervisor: User, operator: User, course: Course
) -> None:
    next_term = Course.objects.create(
        name="Next", slug="next", starts_on=course.starts_on, ends_on=course.ends_on
    )
    client, chosen = signed_in(supervisor), {"action": "copy", "to": "next", "everybody": "on"}
    course.supervisors.add(supervisor)
    assert client.post("/courses/hri/people/", chosen).status_code == 404  # not theirs
    next_term.supervisors.add(supervisor)
    assert client.post("/courses/hri/people/", chosen).status_code == 302
    assert sorted(next_term.enrolments.values_list("number", flat=True)) == ["0", "1"]
    assert course.enrolments.count() == 2


def act(client: Client, action: str, *robots: Robot) -> Any:
    chosen = {"action": action, "_selected_action": [str(one.pk) for one in robots]}
    return client.post(ROBOTS, chosen, follow=True)


def test_robots_are_copied_exported_and_deleted(
    signed_in: SignIn, staff: User, operator: User, robot: Robot, other_robot: Robot
) -> None:
    client = signed_in(staff)
    act(client, "copy_robots", robot, other_robot)
    copy = Robot.objects.get(name=f"{robot.name} copy 1")
    assert (copy.enabled, copy.profile, copy.master_uri) == (False, robot.profile, robot.master_uri)
    settings = act(client, "export_robots", robot, copy).json()
    assert [one["name"] for one in settings] == [robot.name, copy.name]
    assert settings[0]["profile"] == robot.profile.slug
    assert "take it out of service first" in act(client, "delete_robots", robot).text
    Robot.objects.filter(pk=robot.pk).update(enabled=False)
    now = timezone.now()
    Booking.objects.create(
        robot=robot,
        person=operator,
        starts_at=now,
        ends_at=now + timedelta(hours=1),
        held_until=now,
        made_at=now,
    )
    act(client, "delete_robots", robot, copy)
    assert Robot.objects.filter(pk=robot.pk).exists() and not Robot.objects.filter(pk=copy.pk).exists()
    assert Record.objects.get(kind="robot.delete").actor_id == str(staff.pk)
