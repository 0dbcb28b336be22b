"""Booking policies and out-of-service periods, through their pages."""

from datetime import timedelta
from importlib import import_module

import pytest
from django.apps import apps
from django.urls import reverse
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.models import Booking, Notification, OutOfService, Policy
from fleet.bookings.pages.forms import PolicyForm
from fleet.bookings.rules import Slot
from fleet.bookings.schedule import schedules_of
from fleet.bookings.selectors import policies_of, policy_of
from fleet.bookings.services import BookingRefused, booking_make
from robots.access.models import RobotGroup
from tests.bookings.losses.support import confirm
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db


@pytest.fixture
def as_person(client):
    def sign_in(person):
        assert client.login(username=person.username, password=PASSWORD)
        return client

    return sign_in


def typed(**changes):
    """The form's fields as a browser sends them."""
    form = PolicyForm(instance=Policy())
    values = {name: form[name].value() for name in form.fields}
    return {
        name: value for name, value in (values | changes).items() if value is not None and value is not False
    }


def test_a_supervisor_sets_the_rules_of_a_robot(as_person, robot, supervisor, operator):
    address = reverse("booking-policy", args=[robot.slug])
    as_person(supervisor).post(
        address, typed(longest_min=60, mon="13\u201324, 8:00-12.30", sun="08:00-00:00")
    )
    policy = policy_of(robot)
    assert (policy.longest_min, policy.opening["mon"], "tue" in policy.opening) == (
        60,
        [["08:00", "12:30"], ["13:00", "24:00"]],
        False,
    )
    starts = timezone.now() + timedelta(hours=1)
    with pytest.raises(BookingRefused) as caught:
        booking_make(
            robot=robot,
            person=operator,
            slot=Slot(starts, starts + timedelta(hours=2)),
            now=timezone.now(),
        )
    assert "too_long" in [refusal.code for refusal in caught.value.refusals]
    changes = Record.objects.get(kind="policy.change").parameters["changes"]
    assert {"field": "longest_min", "from": 240, "to": 60} in changes


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mon": "10:00"}, "Monday: write opening times such as"),
        ({"tue": "10:00-24:30"}, "Tuesday: write opening times such as"),
        ({"mon": "8-9,9-10,10-11,11-12,12-13,13-14,14-15"}, "at most 6 opening times"),
        ({"mon": "10:00-09:00"}, "closes before it opens"),
        ({"mon": "08:00-12:00, 11:00-13:00"}, "overlap"),
        ({"shortest_min": 300}, "longer than the longest"),
        ({"longest_min": 0}, "greater than or equal to 1"),
    ],
)
def test_a_wrong_policy_is_refused_in_words(as_person, robot, supervisor, changes, words):
    answer = as_person(supervisor).post(reverse("booking-policy", args=[robot.slug]), typed(**changes))
    assert answer.status_code == 400
    assert words in answer.content.decode()
    assert not Policy.objects.exists()


def test_the_hours_of_a_day_are_copied_to_all_days_and_not_saved(as_person, robot, supervisor):
    typed_hours = typed(mon="8-12, 13-18", tue="9-10", longest_min=77, copy="mon")
    answer = as_person(supervisor).post(reverse("booking-policy", args=[robot.slug]), typed_hours)
    assert answer.status_code == 200
    page = answer.content.decode()
    assert (page.count('value="8-12, 13-18"'), 'value="77"' in page) == (7, True)
    assert not Policy.objects.exists()


def test_old_opening_hours_become_a_list_of_one(robot):
    migration = import_module("fleet.bookings.migrations.0011_opening_intervals")
    Policy.objects.create(robot=robot, opening={"mon": ["08:00", "20:00"], "sun": ["10:00", "24:00"]})
    migration.to_intervals(apps, None)
    intervals = {"mon": [["08:00", "20:00"]], "sun": [["10:00", "24:00"]]}
    assert Policy.objects.get().opening == intervals
    migration.to_intervals(apps, None)  # a second run changes nothing
    assert Policy.objects.get().opening == intervals
    migration.to_one_interval(apps, None)
    assert Policy.objects.get().opening["mon"] == ["08:00", "20:00"]


@pytest.mark.parametrize(("person", "status"), [("operator", 403), ("supervisor", 403), ("staff", 200)])
def test_only_staff_see_the_policy_of_all_robots(as_person, request, robot, person, status):
    browser = as_person(request.getfixturevalue(person))
    assert browser.get(reverse("booking-policy-all")).status_code == status


def test_out_of_service_names_the_affected_and_ends(as_person, robot, supervisor, operator):
    now = timezone.now()
    slot = Slot(now + timedelta(hours=1), now + timedelta(hours=2))
    booking_make(robot=robot, person=operator, slot=slot, now=now)
    browser = as_person(supervisor)
    period = {"robots": robot.slug, "starts_at": f"{now:%Y-%m-%dT%H:%M}", "why": "repair", "note": "wheel"}
    asked = browser.post(reverse("out-of-service"), period)
    assert "Olga Operator" in asked.content.decode()
    confirm(browser, asked)
    browser.post(reverse("out-of-service-end", args=[OutOfService.objects.get().pk]))
    assert not OutOfService.objects.filter(ends_at__gt=timezone.now()).exists()
    subjects = Notification.objects.order_by("pk").values_list("subject", flat=True)
    assert [one.partition(": ")[2] for one in subjects] == [
        "the robot is out of service",
        "the robot is back in service",
    ]
    kinds = Record.objects.filter(kind__in=["robot.out_of_service", "robot.back_in_service"]).order_by("id")
    assert [record.kind for record in kinds] == ["robot.out_of_service", "robot.back_in_service"]


def test_a_policy_of_a_group_comes_before_that_of_all(as_person, robot, other_robot, staff, supervisor):
    group = RobotGroup.objects.create(name="The TIAGos", slug="the-tiagos")
    group.robots.set([robot, other_robot])
    address = reverse("booking-policy-group", args=[group.slug])
    assert as_person(supervisor).get(address).status_code == 403
    browser = as_person(staff)
    browser.post(reverse("booking-policy-all"), typed(longest_min=200))
    browser.post(address, typed(longest_min=100))
    browser.post(reverse("booking-policy", args=[other_robot.slug]), typed(longest_min=50))
    assert (policy_of(robot).longest_min, policy_of(other_robot).longest_min) == (100, 50)
    assert "as The TIAGos" in browser.get(reverse("booking-policies")).content.decode()
    assert Record.objects.filter(kind="policy.change", parameters__group=group.slug).count() == 1
    browser.post(address, {"action": "remove"})
    assert policy_of(robot).longest_min == 200
    assert Record.objects.get(kind="policy.remove").parameters["group"] == group.slug


def test_of_two_groups_the_first_by_name_counts(robot):
    for name, minutes in (("B", 20), ("A", 10)):
        group = RobotGroup.objects.create(name=name, slug=name.lower())
        group.robots.add(robot)
        Policy.objects.create(group=group, longest_min=minutes)
    assert policy_of(robot).longest_min == 10


def test_a_group_goes_out_of_service_together(as_person, robot, other_robot, staff):
    group = RobotGroup.objects.create(name="The TIAGos", slug="the-tiagos")
    group.robots.set([robot, other_robot])
    period = {"robots": "group:the-tiagos", "starts_at": "2030-01-05T08:00", "why": "repair"}
    as_person(staff).post(reverse("out-of-service"), period)
    assert {one.robot for one in OutOfService.objects.all()} == {robot, other_robot}


def test_control_follows_the_same_policy_as_the_rules(robot, other_robot, operator, stranger):
    """Control reads policies by a query of its own."""
    now, robots = timezone.now(), (robot, other_robot)
    for one, person in zip(robots, (operator, stranger), strict=True):
        ends = now + timedelta(hours=1)
        Booking.objects.create(
            robot=one, person=person, starts_at=now, ends_at=ends, held_until=ends, made_at=now
        )
    later, first = (RobotGroup.objects.create(name=name, slug=name) for name in ("b", "a"))

    def assert_same(**own):
        Policy.objects.create(**own)
        for one, policy in policies_of(robots).items():
            schedule = schedules_of(robots, now)[one]
            found = schedule.free_time, schedule.current.lapses_at - now
            assert found == (policy.free_time, timedelta(minutes=policy.grace_min))

    assert schedules_of(robots, now)[robot.id].current.lapses_at == now + timedelta(minutes=15)
    assert_same(grace_min=20, free_time=False)
    later.robots.add(robot, other_robot)
    assert_same(group=later, grace_min=30)
    first.robots.add(robot)
    assert_same(group=first, grace_min=40, free_time=False)
    assert_same(robot=other_robot, grace_min=50)
    assert [policy.grace_min for policy in policies_of(robots).values()] == [40, 50]
