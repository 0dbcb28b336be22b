"""Nobody books past the waiting list, whatever frees the time. On SQLite, and on PostgreSQL with FLEET_DATABASE_URL."""

import threading
from datetime import timedelta

import pytest
from django.db import connection
from django.utils import timezone as clock

from fleet.bookings.changes import policy_changes
from fleet.bookings.changes.waiting_list import waiting_join
from fleet.bookings.models import Booking, OutOfService, Policy, State, Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.access.services import role_set
from robots.registry.models import Role
from robots.registry.services import robot_save
from tests.teleop.api.test_bookings import hour, times, wish

pytestmark = pytest.mark.django_db(transaction=True)

ROUNDS = 10
JUMPERS = 4


@pytest.fixture
def jumpers(robot, django_user_model, program):
    """Programs of people who do not wait in line."""
    people = [django_user_model.objects.create_user(f"jumper-{number}") for number in range(JUMPERS)]
    for person in people:
        role_set(robot=robot, user=person, role=Role.OPERATOR, actor=None)
    return [program(person) for person in people]


def waits(robot, person, begins_h=1.0, hours=1.0):
    slot = Slot(hour(begins_h), hour(begins_h + hours))
    return Waiting.objects.create(
        robot=robot, person=person, starts_at=slot.starts_at, ends_at=slot.ends_at, since=clock.now()
    )


def offered_to(robot):
    held = Booking.objects.filter(robot=robot, state=State.OFFERED)
    return [booking.person.username for booking in held]


def address_of(booking):
    return f"/bookings/{booking.pk}"


def seen(booking):
    return {"If_Match": f'"{Booking.objects.get(pk=booking.pk).version}"'}


# Each step frees the hour from 1 to 2 and gets: the booking of that hour, its person's program, and people.
def cancels(taken, api, **_people):
    return api("DELETE", address_of(taken), **seen(taken))


def moves(taken, api, **_people):
    return api("PATCH", address_of(taken), times(5), **seen(taken))


def shortens(taken, api, **_people):
    return api("PATCH", address_of(taken), times(0, 1), **seen(taken))


def loses_the_role(taken, **_people):
    role_set(robot=taken.robot, user=taken.person, role=None, actor=None)


def loses_the_account(taken, **_people):
    taken.person.is_active = False
    taken.person.save()


def declines(taken, api, **_people):
    Booking.objects.update(state=State.OFFERED, offer_until=clock.now() + timedelta(minutes=9))
    return api("DELETE", address_of(taken), **seen(taken))


@pytest.mark.parametrize(
    "frees",
    [cancels, moves, shortens, loses_the_role, loses_the_account, declines],
    ids=lambda step: step.__name__,
)
def test_the_offer_is_made_with_the_change_that_frees_the_time(
    frees, robot, operator, second_operator, program, jumpers
):
    slot = Slot(hour(0 if frees is shortens else 1), hour(2))
    taken = booking_make(robot=robot, person=operator, slot=slot, now=clock.now())
    waiting_join(robot=robot, person=second_operator, slot=Slot(hour(1), hour(2)), now=clock.now())
    answer = frees(taken, api=program(operator))
    assert answer is None or answer.status_code < 300, answer.data
    assert offered_to(robot) == ["second"]
    assert not Waiting.objects.exists()
    assert jumpers[0]("POST", "/bookings", wish(robot)).data["code"] == "taken"


def service_resumes(robot, staff, period):
    policy_changes.out_of_service_end(period_id=period.pk, actor=staff, now=clock.now())


def opens_longer(robot, staff, **_facts):
    values = {name: getattr(Policy(), name) for name in policy_changes.POLICY_FIELDS}
    policy_changes.policy_set(robot=robot, values=values, actor=staff)


def loses_its_policy(robot, staff, **_facts):
    policy_changes.policy_remove(robot=robot, actor=staff)


def is_switched_on(robot, staff, **_facts):
    robot.enabled = True
    robot_save(robot=robot, actor=staff)


@pytest.mark.parametrize(
    "frees", [service_resumes, opens_longer, loses_its_policy, is_switched_on], ids=lambda step: step.__name__
)
def test_the_offer_is_made_when_the_robot_can_be_booked_again(frees, robot, staff, second_operator, jumpers):
    period = None
    if frees is service_resumes:
        period = OutOfService.objects.create(robot=robot, starts_at=hour(-2), ends_at=hour(9), why="repair")
    elif frees is is_switched_on:
        type(robot).objects.update(enabled=False)
        robot.refresh_from_db()
    else:
        Policy.objects.create(robot=robot, opening={"mon": [["00:00", "00:01"]]})
    waits(robot, second_operator)
    frees(robot=robot, staff=staff, period=period)
    assert offered_to(robot) == ["second"]
    assert jumpers[0]("POST", "/bookings", wish(robot)).data["code"] == "taken"


def test_time_that_the_clock_freed_is_offered_before_anybody_books_it(
    robot, operator, second_operator, jumpers
):
    starts = clock.now() - timedelta(minutes=20)  # the grace time is over
    Booking.objects.create(
        robot=robot, person=operator, starts_at=starts, ends_at=hour(3), held_until=hour(3), made_at=starts
    )
    waits(robot, second_operator)
    assert jumpers[0]("POST", "/bookings", wish(robot)).data["code"] == "taken"
    assert jumpers[0]("POST", "/bookings", wish(robot, 2)).status_code == 201  # nobody waits for this hour
    assert offered_to(robot) == ["second"]


def test_of_people_who_book_while_the_slot_is_cancelled_none_gets_it(
    robot, operator, second_operator, program, jumpers
):
    owner = program(operator)
    for round_number in range(ROUNDS):
        slot = Slot(hour(1), hour(2))
        taken = booking_make(robot=robot, person=operator, slot=slot, now=clock.now())
        waiting_join(robot=robot, person=second_operator, slot=slot, now=clock.now())
        version, over, got = seen(taken), threading.Event(), []

        def jump(api, over=over, got=got):
            try:
                while not over.is_set():
                    got.append(api("POST", "/bookings", wish(robot)).data.get("code", "booked"))
                got.append(api("POST", "/bookings", wish(robot)).data.get("code", "booked"))
            finally:
                connection.close()

        threads = [threading.Thread(target=jump, args=[api]) for api in jumpers]
        for thread in threads:
            thread.start()
        answer = owner("DELETE", address_of(taken), **version)
        over.set()
        for thread in threads:
            thread.join()
        assert answer.status_code < 300, answer.data
        assert set(got) == {"taken"}, (round_number, got)
        assert offered_to(robot) == ["second"]
        Booking.objects.all().delete()


def test_an_offer_is_accepted_only_within_the_quota(robot, operator, second_operator, program):
    Policy.objects.create(robot=robot, day_min=None, week_min=60)
    begins_h = 1.0 if hour(1).isocalendar().week == hour(8).isocalendar().week else 24.0  # all in one week
    api, taken = program(second_operator), program(operator)("POST", "/bookings", wish(robot, begins_h)).data
    waits(robot, second_operator, begins_h)
    program(operator)("DELETE", f"/bookings/{taken['id']}", If_Match='"1"')
    offer = Booking.objects.get(state=State.OFFERED)
    # another process offered or booked at the same moment: two transactions do not see each other's
    Booking.objects.create(
        robot=robot,
        person=second_operator,
        starts_at=hour(begins_h + 4),
        ends_at=hour(begins_h + 5),
        held_until=hour(begins_h + 5),
        made_at=clock.now(),
    )
    refused = api("POST", f"/bookings/{offer.pk}/accept")
    assert (refused.status_code, refused.data["code"]) == (409, "quota_week")
    assert refused.data["figures"]["left_min"] == 0
