"""A booking that is handed to a colleague: they are asked first."""

import re
from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.changes.handing import hand_offers_lapse
from fleet.bookings.lessons.members import shares
from fleet.bookings.models import Booking, HandOffer, Notification, Policy
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_cancel, booking_make
from robots.access.models import Course, Enrolment
from robots.registry.models import RobotRole

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def booking(robot, operator):
    starts = timezone.now().replace(microsecond=0) + timedelta(days=2)
    slot = Slot(starts, starts + timedelta(hours=1))
    return booking_make(robot=robot, person=operator, slot=slot, now=timezone.now())


def ask(browser, booking, to):
    form = {"action": "hand", "version": booking.version, "to": to.username}
    return browser.post(reverse("booking", args=[booking.pk]), form)


def answer(browser, how, **more):
    offer = HandOffer.objects.latest("made_at")
    return browser.post(reverse("hand-answer", args=[offer.pk]), {"answer": how, **more}, follow=True)


def owner_of(booking):
    booking.refresh_from_db()
    return booking.person


def subjects(person):
    return list(Notification.objects.filter(person=person).order_by("pk").values_list("subject", flat=True))


def test_a_colleague_is_asked_and_accepts(signed_in, booking, operator, second_operator):
    giver, colleague = signed_in(operator), signed_in(second_operator)
    ask(giver, booking, second_operator)
    assert owner_of(booking) == operator
    assert "Olaf Operator is asked" in giver.get(reverse("booking", args=[booking.pk])).text
    assert "wants to hand you" in subjects(second_operator)[0]
    assert "Colleagues ask you" in colleague.get(reverse("bookings-mine")).text
    answer(colleague, "accept")
    assert owner_of(booking) == second_operator
    assert "Olaf Operator accepted it" in subjects(operator)[-1]
    answer(colleague, "accept")  # twice does nothing
    assert HandOffer.objects.get().outcome == "accepted"


def test_until_they_accept_nothing_counts_for_them(signed_in, booking, robot, operator, second_operator):
    Policy.objects.create(robot=robot, at_once=1)
    ask(signed_in(operator), booking, second_operator)
    starts = booking.ends_at + timedelta(hours=1)
    slot = Slot(starts, starts + timedelta(hours=1))
    booking_make(robot=robot, person=second_operator, slot=slot, now=timezone.now())
    page = answer(signed_in(second_operator), "accept")
    assert owner_of(booking) == operator
    assert "bookings to come" in page.text  # their quota has no room for it now
    assert HandOffer.objects.get().outcome == ""


def test_a_colleague_declines(signed_in, booking, operator, second_operator, supervisor):
    ask(signed_in(operator), booking, second_operator)
    assert "is over" in answer(signed_in(supervisor), "accept").text  # it is for another person
    answer(signed_in(second_operator), "decline")
    assert owner_of(booking) == operator
    assert "Olaf Operator declined it" in subjects(operator)[-1]
    assert "is over" in answer(signed_in(second_operator), "accept").text


def test_an_offer_ends_in_each_of_its_ways(signed_in, booking, operator, second_operator, supervisor):
    giver, colleague = signed_in(operator), signed_in(second_operator)
    ask(giver, booking, second_operator)
    answer(giver, "withdraw")
    assert "is over" in answer(colleague, "accept").text
    ask(giver, booking, second_operator)
    ask(giver, booking, supervisor)
    assert "Colleagues ask you" not in colleague.get(reverse("bookings-mine")).text
    hand_offers_lapse(timezone.now() + timedelta(days=1, minutes=1))
    assert HandOffer.objects.get(to=supervisor).outcome == "lapsed"
    assert "nobody accepted it in time" in subjects(operator)[-1]
    ask(giver, booking, second_operator)
    booking.version += 1
    booking.save()
    assert "changed" in answer(colleague, "accept").text
    assert owner_of(booking) == operator


def test_a_link_hands_the_booking_to_whoever_accepts_first(
    signed_in, booking, robot, operator, second_operator, stranger, supervisor
):
    made = (
        signed_in(operator)
        .post(reverse("hand-make-link", args=[booking.pk]), {"version": booking.version})
        .text
    )
    path = re.search(r"/bookings/hand/link/[^<]+", made)[0]
    assert "<svg" in made
    code = path.rstrip("/").rpartition("/")[2]
    assert code not in str(HandOffer.objects.values())
    assert "Olga Operator" in signed_in(second_operator).get(path).text
    assert signed_in(second_operator).get(path + "x/").status_code == 404
    refused = answer(signed_in(stranger), "accept", code=code)
    assert (refused.status_code, "may not drive" in refused.text) == (409, True)
    answer(signed_in(second_operator), "accept", code=code)
    assert owner_of(booking) == second_operator
    assert signed_in(supervisor).get(path).status_code == 404


def test_the_names_to_choose_from_are_those_of_ones_courses(
    signed_in, booking, robot, operator, second_operator, supervisor, stranger
):
    page = signed_in(operator).get(reverse("booking", args=[booking.pk])).text
    assert "Olaf Operator" not in page  # the operator may not learn of others on the robot
    assert "Olaf Operator" in signed_in(supervisor).get(reverse("booking", args=[booking.pk])).text
    today = timezone.localdate()
    course = Course.objects.create(name="HRI", slug="hri", starts_on=today, ends_on=today + timedelta(days=9))
    course.robots.add(robot)
    RobotRole.objects.filter(user=second_operator).delete()
    for person in (operator, second_operator):
        Enrolment.objects.create(course=course, person=person)
    page = signed_in(operator).get(reverse("booking", args=[booking.pk])).text
    assert "Olaf Operator" in page and stranger.display_name not in page


# --- asked to share it ----------------------------------------------------------------------------


def share(browser, robot, *others, **more):
    starts = timezone.localtime() + timedelta(days=2)
    typed = {"starts_at": starts, "ends_at": starts + timedelta(hours=1)}
    times = {name: moment.strftime("%Y-%m-%dT%H:%M") for name, moment in typed.items()}
    form = {"robot": robot.slug, **times, "team": ", ".join(one.username for one in others), **more}
    page = browser.post(reverse("booking-new"), form, follow=True, headers={"accept": "text/html"})
    assert page.redirect_chain, page.text
    return Booking.objects.get(), page


def in_team(booking):
    return [one.person for one in booking.members.order_by("pk")]


def test_a_team_is_asked_and_who_accepts_is_in_it(signed_in, robot, operator, second_operator, supervisor):
    browser, colleague = signed_in(operator), signed_in(second_operator)
    booking, page = share(browser, robot, second_operator, supervisor, turn_min="10")
    assert (booking.shared, in_team(booking)) == ("people", [])
    assert "Olaf Operator" in page.text and "Asked whether they share it" in page.text
    assert "asks you to share a booking" in subjects(second_operator)[0]
    assert "to share" in colleague.get(reverse("bookings-mine")).text
    assert not shares(booking, second_operator)
    ask(browser, booking, supervisor)  # another question, which replaces none of these
    assert HandOffer.objects.filter(outcome="", share=True).count() == 2
    Booking.objects.update(version=5)  # it was moved: the question is about the new time
    offer = HandOffer.objects.get(to=second_operator)
    colleague.post(reverse("hand-answer", args=[offer.pk]), {"answer": "accept"})
    assert in_team(booking) == [second_operator] and shares(booking, second_operator)
    assert owner_of(booking) == operator
    assert "Olaf Operator accepted it" in subjects(operator)[-1]
    assert Record.objects.get(kind="booking.join").actor_id == str(second_operator.pk)
    page = browser.get(reverse("booking", args=[booking.pk])).text
    assert "Asked to share it" in page and "Together with" in page


def test_nobody_joins_a_team_that_declined_or_is_over(
    signed_in, robot, operator, second_operator, supervisor
):
    browser, colleague = signed_in(operator), signed_in(second_operator)
    booking, _page = share(browser, robot, second_operator)
    assert "is over" in answer(signed_in(supervisor), "accept").text  # nobody asked them
    RobotRole.objects.filter(user=second_operator).update(role="observer")
    assert "may not drive" in answer(colleague, "accept").text
    RobotRole.objects.filter(user=second_operator).update(role="operator")
    booking_cancel(booking_id=booking.pk, version=1, actor=operator, now=timezone.now())
    assert "Colleagues ask you" not in colleague.get(reverse("bookings-mine")).text
    assert "is over" in answer(colleague, "accept").text
    answer(colleague, "decline")
    assert "Olaf Operator declined it" in subjects(operator)[-1]
    assert in_team(booking) == []


def test_who_may_book_for_people_puts_them_into_a_team(signed_in, robot, supervisor, operator):
    booking, page = share(signed_in(supervisor), robot, operator)
    assert in_team(booking) == [operator] and "Asked whether" not in page.text
    assert not HandOffer.objects.exists()
