"""The pages of bookings, through the public address."""

from datetime import UTC, datetime, timedelta

import pytest
from django.urls import reverse
from django.utils import timezone as django_timezone

from fleet.bookings.models import Booking, Policy, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.registry.models import RobotProfile
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db

JSON = {"HTTP_ACCEPT": "application/json"}
HTML = {"HTTP_ACCEPT": "text/html"}


def in_hours(hours):
    return django_timezone.now().replace(minute=0, second=0, microsecond=0) + timedelta(hours=hours)


def fields(robot, begins_h=2, hours=1.0, **others):
    starts = in_hours(begins_h)
    times = {"starts_at": starts, "ends_at": starts + timedelta(hours=hours)}
    return {
        "robot": robot.slug,
        **{name: at.strftime("%Y-%m-%dT%H:%M") for name, at in times.items()},
        **others,
    }


@pytest.fixture
def as_person(client):
    def sign_in(person):
        assert client.login(username=person.username, password=PASSWORD)
        return client

    return sign_in


def test_a_student_books_by_the_form_and_sees_it(as_person, robot, operator):
    browser = as_person(operator)
    answer = browser.post(reverse("booking-new"), fields(robot), follow=True, **HTML)
    assert answer.redirect_chain == [(reverse("bookings-mine"), 302)]
    booking = Booking.objects.get()
    assert (booking.person, booking.starts_at) == (operator, in_hours(2))
    assert f"/bookings/{booking.pk}/" in answer.content.decode()


def test_all_refusals_stand_on_the_page_with_alternatives(as_person, robot, operator, second_operator):
    booking_make(
        robot=robot,
        person=second_operator,
        slot=Slot(in_hours(2), in_hours(3)),
        now=django_timezone.now(),
    )
    answer = as_person(operator).post(reverse("booking-new"), fields(robot, hours=5), **HTML)
    page = answer.content.decode()
    assert answer.status_code == 409
    assert 'data-code="taken"' in page
    assert 'data-code="too_long"' in page
    assert "Olaf Operator has booked" in page
    assert "Free instead" in page


def test_a_script_gets_refusals_as_data(as_person, robot, operator):
    answer = as_person(operator).post(reverse("booking-new"), fields(robot, begins_h=-3), **JSON)
    assert answer.status_code == 409
    assert [refusal["code"] for refusal in answer.json()["refusals"]] == ["in_past"]


@pytest.mark.parametrize(
    "typed", ["", "tomorrow", "2026-13-01T10:00", "99999-01-01T10:00", "2026-03-02T10:00Z"]
)
def test_a_wrong_time_is_refused_in_words(as_person, robot, operator, typed):
    answer = as_person(operator).post(reverse("booking-new"), {**fields(robot), "starts_at": typed}, **JSON)
    assert answer.status_code == 409
    assert answer.json()["refusals"][0]["text"].startswith("From: ")


def test_robots_that_one_may_not_see_are_no_choice(as_person, robot, stranger):
    assert as_person(stranger).post(reverse("booking-new"), fields(robot), **JSON).status_code == 409
    assert Booking.objects.count() == 0


def test_a_moved_booking_in_a_second_tab_is_refused(as_person, robot, operator):
    browser = as_person(operator)
    browser.post(reverse("booking-new"), fields(robot))
    address = reverse("booking", args=[Booking.objects.get().pk])
    move = {**fields(robot, 5), "action": "move", "version": 1}
    assert browser.post(address, move, **JSON).status_code == 200
    late = browser.post(address, {**move, **fields(robot, 8)}, **JSON)
    assert (late.status_code, late.json()["refusals"][0]["code"]) == (409, "changed")
    assert Booking.objects.get().starts_at == in_hours(5)


def test_a_refused_second_tab_keeps_what_was_typed(as_person, robot, operator):
    browser = as_person(operator)
    browser.post(reverse("booking-new"), fields(robot))
    address = reverse("booking", args=[Booking.objects.get().pk])
    browser.post(address, {**fields(robot, 5), "action": "move", "version": 1})
    wanted = fields(robot, 8)
    page = browser.post(address, {**wanted, "action": "move", "version": 1}, **HTML).content.decode()
    assert "Not changed:" in page and 'data-code="changed"' in page
    assert f"{in_hours(5):%H:%M}" in page.split("</h1>")[0]  # the heading shows the stored time
    assert f'name="starts_at" value="{wanted["starts_at"]}"' in page
    browser.post(address, {**wanted, "action": "move", "version": 2})
    assert Booking.objects.get().starts_at == in_hours(8)


def test_cancelling_from_ones_own_list_frees_the_slot(as_person, robot, operator):
    browser = as_person(operator)
    browser.post(reverse("booking-new"), fields(robot))
    booking = Booking.objects.get()
    browser.post(reverse("booking", args=[booking.pk]), {"action": "cancel", "version": 1})
    booking.refresh_from_db()
    assert booking.state == State.CANCELLED
    assert "cancelled" in browser.get(reverse("bookings-mine")).content.decode()


def test_the_feed_has_robots_and_bookings_of_the_days(
    as_person, robot, operator, django_assert_max_num_queries
):
    browser = as_person(operator)
    browser.post(reverse("booking-new"), fields(robot))
    days = {"start": str(in_hours(0).date()), "end": str((in_hours(48)).date())}
    with django_assert_max_num_queries(12):
        answer = browser.get(reverse("bookings-feed"), days)
    assert [one["id"] for one in answer.json()["resources"]] == [robot.slug]
    [event] = answer.json()["events"]
    assert (event["title"], event["editable"]) == ("Olga Operator", True)
    assert browser.get(reverse("bookings-feed"), {"start": "x"}).status_code == 400


def test_next_free_leads_to_the_filled_form(as_person, robot, operator):
    answer = as_person(operator).get(reverse("bookings-next-free"))
    assert answer.url.startswith(f"{reverse('booking-new')}?robot={robot.slug}&from=")
    assert as_person(operator).get(answer.url).status_code == 200


def test_a_changed_booking_is_described_and_leads_back(as_person, robot, operator, second_operator):
    browser = as_person(operator)
    booking = booking_make(
        robot=robot,
        person=operator,
        slot=Slot(in_hours(2), in_hours(3)),
        now=datetime.now(UTC),
    )
    address, mine = reverse("booking", args=[booking.pk]), reverse("bookings-mine")
    own = browser.post(address, {"action": "hand", "version": 1, "to": operator.username}, **HTML)
    assert "Not changed:" in own.content.decode()
    assert "the booking of Olga Operator already" in own.content.decode()
    answer = browser.post(address, {"action": "cancel", "version": 1, "back": mine}, follow=True, **HTML)
    assert answer.redirect_chain == [(mine, 302)]
    assert f"Cancelled: {robot.name}, " in answer.content.decode()
    other = booking_make(
        robot=robot,
        person=operator,
        slot=Slot(in_hours(4), in_hours(5)),
        now=datetime.now(UTC),
    )
    address = reverse("booking", args=[other.pk])
    handed = {
        "action": "hand",
        "version": 1,
        "to": second_operator.username,
        "back": "https://elsewhere.example/",
    }
    answer = browser.post(address, handed, follow=True, **HTML)
    assert answer.redirect_chain == [(address, 302)]
    assert "Olaf Operator is asked" in answer.content.decode()


def test_a_supervisor_finds_what_awaits_approval(as_person, robot, operator, supervisor, second_operator):
    Policy.objects.create(robot=robot, needs_approval=True)
    answer = as_person(operator).post(reverse("booking-new"), fields(robot), follow=True, **HTML)
    assert "awaits approval" in answer.content.decode()
    page = as_person(supervisor).get(reverse("bookings")).content.decode()
    assert "Awaiting approval" in page
    assert "1 booking awaits approval" in as_person(supervisor).get(reverse("today")).content.decode()
    assert "Awaiting approval" not in as_person(second_operator).get(reverse("bookings")).content.decode()
    booking = Booking.objects.get()
    data = {"action": "approve", "version": booking.version, "back": reverse("bookings")}
    answer = as_person(supervisor).post(reverse("booking", args=[booking.pk]), data, follow=True, **HTML)
    assert f"Approved: {robot.name}" in answer.content.decode()
    assert "Awaiting approval" not in answer.content.decode()


def test_a_booking_in_use_is_finished_not_cancelled(as_person, robot, operator):
    now = datetime.now(UTC)
    booking_make(robot=robot, person=operator, slot=Slot(now, now + timedelta(hours=1)), now=now)
    page = as_person(operator).get(reverse("bookings-mine")).content.decode()
    assert ">Finish<" in page and ">Cancel<" not in page


def test_each_kind_of_robot_has_its_next_free_hour(as_person, robot, other_robot, staff):
    for slug in ("tiago", "tiago-ros2"):  # one kind: who books does not ask for a robot's ROS
        other_robot.profile = RobotProfile.objects.get(slug=slug)
        other_robot.save()
        assert "Next free hour:" not in as_person(staff).get(reverse("bookings")).content.decode()
    other_robot.profile = RobotProfile.objects.get(slug="pmb2-ros2")
    other_robot.save()
    page = as_person(staff).get(reverse("bookings")).content.decode()
    address = reverse("bookings-next-free") + "?kind=PAL%20PMB-2"
    assert f'href="{address}"' in page
    assert f"robot={other_robot.slug}&" in as_person(staff).get(address).url


def test_an_offer_is_accepted_or_declined(as_person, robot, operator):
    now = datetime.now(UTC)
    booking = booking_make(robot=robot, person=operator, slot=Slot(in_hours(3), in_hours(4)), now=now)
    Booking.objects.filter(pk=booking.pk).update(state=State.OFFERED, offer_until=in_hours(2))
    page = as_person(operator).get(reverse("bookings-mine")).content.decode()
    assert ">Accept<" in page and ">Decline<" in page and ">Cancel<" not in page


def test_only_people_who_may_see_the_robot_see_a_booking(as_person, robot, operator, stranger):
    booking = booking_make(
        robot=robot,
        person=operator,
        slot=Slot(in_hours(2), in_hours(3)),
        now=datetime.now(UTC),
    )
    assert as_person(stranger).get(reverse("booking", args=[booking.pk])).status_code == 404
