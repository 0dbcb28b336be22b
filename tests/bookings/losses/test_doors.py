"""Every door that can take time from people asks first, by name, and its change can be undone for a day."""

from datetime import datetime, time, timedelta
from uuid import uuid4

import pytest
from django.core.management import CommandError, call_command
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.changes.waiting_list import waiting_join
from fleet.bookings.models import (
    WEEKDAYS,
    Booking,
    Change,
    Notification,
    OutOfService,
    Policy,
    State,
    Waiting,
)
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from fleet.site.management.commands import erase_person
from robots.access.models import (
    Course,
    Enrolment,
    GroupRole,
    Qualification,
    QualificationGrant,
    RobotGroup,
)
from robots.registry.models import RobotRole, Role
from tests.bookings.losses.support import confirm, fields_of
from tests.bookings.test_policies import typed
from tests.bookings.test_races import all_at_once
from tests.robots.registry.test_admin import filled

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def door(staff):
    client = Client()
    client.force_login(staff)
    return client


@pytest.fixture
def course(robot, operator, staff):
    """A course by which the operator may drive, besides no role of their own."""
    RobotRole.objects.filter(user=operator).delete()
    today = timezone.localdate()
    made = Course.objects.create(name="HRI", slug="hri", starts_on=today, ends_on=today + timedelta(days=20))
    made.robots.add(robot)
    Enrolment.objects.create(course=made, person=operator)
    return made


def book(robot, person, days=2, **options):
    starts = (timezone.now() + timedelta(days=days)).replace(hour=10, minute=0, second=0, microsecond=0)
    slot = Slot(starts, starts + timedelta(hours=1))
    return booking_make(robot=robot, person=person, slot=slot, now=timezone.now(), **options)


def state_of(booking):
    booking.refresh_from_db()
    return State(booking.state)


# --- the doors: each returns its address and its form -----------------------------------------------


def archive(course, **_):
    return reverse("course-archive", args=[course.slug]), {"archived": "1"}


def shorten_course(course, robot, **_):
    today = timezone.localdate()
    form = {
        "name": course.name,
        "robots": str(robot.pk),
        "role": "operator",
        "starts_on": today,
        "ends_on": today,
    }
    return reverse("course-edit", args=[course.slug]), form


def unenrol(course, operator, **_):
    return reverse("course-people", args=[course.slug]), {"action": "unenrol", "person": operator.pk}


def demand(robot, **_):
    return reverse("qualifications"), {"new-name": "Induction", "new-robots": str(robot.pk)}


def out_of_service(robot, **_):
    form = {"robots": robot.slug, "starts_at": "2020-01-01T00:00", "why": "repair", "note": "wheel"}
    return reverse("out-of-service"), form


def close_hours(robot, **_):
    return reverse("booking-policy", args=[robot.slug]), typed(**dict.fromkeys(WEEKDAYS, "01:00-02:00"))


def close_account(operator, **_):
    return reverse("admin:accounts_user_change", args=[operator.pk]), {
        "username": "operator",
        "full_name": "Olga Operator",
    }


DOORS = {
    archive: "Course archived: HRI",
    shorten_course: "Course changed: HRI",
    unenrol: "Taken out of a course: HRI",
    demand: "Qualification made: Induction",
    close_hours: "Booking policy changed: TIAGo 1",
    close_account: "Account changed",
}


@pytest.mark.parametrize(("way", "title"), DOORS.items())
def test_a_door_asks_by_name_before_it_takes_time_and_undoes_it(
    door, course, robot, operator, staff, way, title
):
    booking = book(robot, operator)
    address, form = way(course=course, robot=robot, operator=operator)
    asked = door.post(address, form)
    assert asked.status_code == 409
    assert operator.display_name in asked.text and title in asked.text
    assert state_of(booking) is State.BOOKED
    assert not Change.objects.exists() and not Notification.objects.exists()

    done = confirm(door, asked)
    assert done.status_code == 302
    assert state_of(booking) is State.CANCELLED
    change = Change.objects.get()
    page = door.get(reverse("change", args=[change.pk]))
    assert operator.display_name in page.text

    undone = door.post(reverse("change-undo", args=[change.pk]))
    assert undone.status_code == 302
    assert state_of(booking) is State.BOOKED
    assert Record.objects.filter(kind="booking.undo").count() == 1
    # and the right is really back
    assert door.post(address, form).status_code == 409


def test_the_log_names_what_an_undo_gives_back(door, staff, course, robot, operator):
    booking = book(robot, operator)
    confirm(door, door.post(*unenrol(course, operator)))
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    kinds = ("course.unenrol", "entry.restore", "booking.restore")
    [gone, back, again] = Record.objects.filter(kind__in=kinds).order_by("pk")
    assert gone.parameters == {"course": "hri", "people": [str(operator.pk)]}
    facts = {"entry": "enrolment", "what": "added", "course": "hri", "person": str(operator.pk)}
    assert (back.actor_id, back.parameters) == (
        str(staff.pk),
        facts | {"change": str(Change.objects.get().pk)},
    )
    assert (again.parameters["booking"], again.parameters["person"]) == (str(booking.pk), str(operator.pk))


@pytest.mark.parametrize(
    ("way", "facts"),
    [
        (archive, {"entry": "course", "what": "changed", "fields": ["archived"], "course": "hri"}),
        (
            demand,
            {
                "entry": "qualification_robots",
                "what": "removed",
                "qualification": "induction",
                "robot": "tiago-1",
            },
        ),
    ],
)
def test_the_log_names_rules_by_their_slugs(door, course, robot, operator, way, facts):
    book(robot, operator)
    confirm(door, door.post(*way(course=course, robot=robot)))
    change = Change.objects.get()
    door.post(reverse("change-undo", args=[change.pk]))
    told = [one.parameters for one in Record.objects.filter(kind="entry.restore")]
    assert facts | {"change": str(change.pk)} in [
        {name: value for name, value in one.items() if name != "role"} for one in told
    ]


def test_only_who_may_still_change_the_entries_undoes_it(door, staff, course, robot, operator, stranger):
    course.supervisors.add(stranger)
    booking = book(robot, operator)
    teacher = Client()
    teacher.force_login(stranger)
    address, form = unenrol(course, operator)
    confirm(teacher, teacher.post(address, form))
    page = reverse("change", args=[Change.objects.get().pk])
    undo = reverse("change-undo", args=[Change.objects.get().pk])

    course.supervisors.remove(stranger)
    teacher.post(undo)
    assert state_of(booking) is State.CANCELLED
    assert not course.enrolments.exists()
    assert undo not in teacher.get(page).text

    course.supervisors.add(stranger)
    assert undo in teacher.get(page).text
    teacher.post(undo)
    assert state_of(booking) is State.BOOKED

    confirm(door, door.post(*close_account(operator)))
    User.objects.filter(pk=staff.pk).update(is_staff=False)
    door.post(reverse("change-undo", args=[Change.objects.latest("made_at").pk]))
    operator.refresh_from_db()
    assert not operator.is_active


def take_role(robot, role, **_):
    return reverse("admin:robots_robotrole_delete", args=[role.pk]), {"post": "yes"}


def lower_role(robot, role, operator, **_):
    form = {"robot": str(robot.pk), "user": str(operator.pk), "role": "observer", "_save": "Save"}
    return reverse("admin:robots_robotrole_change", args=[role.pk]), form


def take_group_role(group, operator, **_):
    return reverse("robot-groups"), {"entry": group.slug, "action": "role", "username": operator.username}


def delete_group(group, **_):
    return reverse("robot-groups"), {"entry": group.slug, "action": "delete"}


@pytest.mark.parametrize("way", [take_role, lower_role, take_group_role, delete_group])
def test_a_role_that_goes_is_asked_for_and_comes_back(door, robot, operator, way):
    role = RobotRole.objects.get(user=operator)
    group = RobotGroup.objects.create(name="The TIAGos", slug="the-tiagos")
    group.robots.add(robot)
    if "group" in way.__name__:
        role.delete()
        GroupRole.objects.create(group=group, user=operator, role=Role.OPERATOR)
    booking = book(robot, operator)
    address, form = way(robot=robot, role=role, group=group, operator=operator)
    asked = door.post(address, form)
    assert (asked.status_code, state_of(booking)) == (409, State.BOOKED)
    assert confirm(door, asked).status_code == 302
    assert state_of(booking) is State.CANCELLED
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    assert state_of(booking) is State.BOOKED


def switch_off(robot, door, **_):
    address = reverse("admin:robots_robot_change", args=[robot.pk])
    form = filled(door, address)
    del form["enabled"]
    return address, form


@pytest.mark.parametrize("way", [out_of_service, switch_off])
def test_a_robot_that_goes_keeps_its_bookings_but_says_whom_it_leaves(door, robot, operator, way):
    booking = book(robot, operator)
    address, form = way(robot=robot, door=door)
    asked = door.post(address, form)
    assert asked.status_code == 409
    assert operator.display_name in asked.text
    robot.refresh_from_db()
    assert (robot.enabled, OutOfService.objects.count()) == (True, 0)
    assert confirm(door, asked).status_code == 302
    robot.refresh_from_db()
    assert (robot.enabled, OutOfService.objects.count()) in ((False, 0), (True, 1))
    assert state_of(booking) is State.BOOKED
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    robot.refresh_from_db()
    assert (robot.enabled, OutOfService.objects.count()) == (True, 0)
    assert [one.person for one in Notification.objects.all()] == [operator, operator]  # taken, and given back


def test_what_others_booked_meanwhile_stays_theirs(door, course, robot, operator, second_operator):
    booking = book(robot, operator)
    other = book(robot, operator, days=3)
    asked = door.post(*unenrol(course=course, operator=operator))
    confirm(door, asked)
    RobotRole.objects.update_or_create(user=second_operator, robot=robot, defaults={"role": Role.OPERATOR})
    theirs = book(robot, second_operator)
    assert door.get(reverse("change", args=[Change.objects.get().pk])).text.count("cannot come back") == 1
    undone = door.post(reverse("change-undo", args=[Change.objects.get().pk]), follow=True)
    assert [state_of(one) for one in (booking, other, theirs)] == [
        State.CANCELLED,
        State.BOOKED,
        State.BOOKED,
    ]
    assert "1 booking came back" in undone.text and "taken by others" in undone.text
    again = door.post(reverse("change-undo", args=[Change.objects.get().pk]), follow=True)
    assert "undone already" in again.text


def test_a_change_can_be_undone_for_a_day_by_its_maker_and_staff(
    door, course, robot, operator, supervisor, staff
):
    book(robot, operator)
    confirm(door, door.post(*unenrol(course=course, operator=operator)))
    change = Change.objects.get()
    other = Client()
    other.force_login(supervisor)
    assert other.get(reverse("change", args=[change.pk])).status_code == 404
    assert other.post(reverse("change-undo", args=[change.pk])).status_code == 404
    Change.objects.update(made_at=timezone.now() - timedelta(days=1, minutes=1))
    late = door.post(reverse("change-undo", args=[change.pk]), follow=True)
    assert "for a day" in late.text
    assert not Enrolment.objects.exists()


def test_losses_that_changed_since_they_were_shown_are_shown_again(door, course, robot, operator):
    book(robot, operator)
    asked = door.post(*archive(course=course))
    late = book(robot, operator, days=4)
    again = confirm(door, asked)
    assert (again.status_code, state_of(late)) == (409, State.BOOKED)
    assert "Look again" in again.text
    assert confirm(door, again).status_code == 302
    assert state_of(late) is State.CANCELLED


def test_open_again_gives_back_what_archive_took(door, course, robot, operator, staff):
    lesson = book(robot, staff, series=uuid4(), lesson_of=course)
    mine = book(robot, operator, days=3)
    asked = door.post(*archive(course=course))
    assert staff.display_name in asked.text and "and 1 person who shares it" in asked.text
    confirm(door, asked)
    letter = Notification.objects.get(person=operator)
    assert letter.text.count("cancelled") == 2  # the lesson is theirs, too
    assert (state_of(lesson), state_of(mine)) == (State.CANCELLED, State.CANCELLED)
    Change.objects.update(
        made_at=timezone.now() - timedelta(days=30)
    )  # opening again is no undo: it has no end
    opened = door.post(reverse("course-archive", args=[course.slug]), {"archived": "0"}, follow=True)
    assert "2 bookings came back" in opened.text
    assert (state_of(lesson), state_of(mine)) == (State.BOOKED, State.BOOKED)


def test_who_waits_gets_no_time_that_comes_back(door, course, robot, operator, stranger):
    Enrolment.objects.create(course=course, person=stranger)
    booking = book(robot, operator)
    slot = Slot(booking.starts_at, booking.ends_at)
    waiting_join(robot=robot, person=stranger, slot=slot, now=timezone.now())
    confirm(door, door.post(*archive(course=course)))
    assert Waiting.objects.exists()  # without a right, the time is not offered
    door.post(reverse("course-archive", args=[course.slug]), {"archived": "0"})
    assert (state_of(booking), Waiting.objects.count()) == (State.BOOKED, 1)


def test_lessons_after_a_new_last_day_are_freed(door, course, robot, operator, staff):
    lesson = book(robot, staff, series=uuid4(), lesson_of=course)
    asked = door.post(*shorten_course(course=course, robot=robot))
    assert (asked.status_code, state_of(lesson)) == (409, State.BOOKED)
    confirm(door, asked)
    assert state_of(lesson) is State.CANCELLED


def test_bookings_outside_of_new_hours_may_stay(door, robot, operator):
    booking = book(robot, operator)
    asked = door.post(*close_hours(robot=robot))
    assert (asked.status_code, Policy.objects.count()) == (409, 0)
    assert confirm(door, asked, closed_stay="1").status_code == 302
    assert (state_of(booking), Policy.objects.count()) == (State.BOOKED, 1)
    same = door.post(*close_hours(robot=robot))
    assert same.status_code == 302  # it was outside before: this change takes nothing


def test_one_letter_tells_a_person_of_all_their_losses(door, course, robot, operator):
    for days in (2, 3, 4):
        book(robot, operator, days=days)
    confirm(door, door.post(*archive(course=course)))
    letter = Notification.objects.get()
    assert (letter.person, letter.text.count("cancelled")) == (operator, 3)
    assert "Sam Staff" in letter.text


def test_a_booking_against_the_policy_of_a_closed_account_is_freed(robot, stranger, staff):
    booking = book(robot, stranger, actor=staff, override="gets the role on Monday")
    stranger.is_active = False
    stranger.save()
    assert state_of(booking) is State.CANCELLED


def test_erasing_asks_for_bookings_too_and_cannot_be_undone(door, robot, operator, capsys):
    booking = book(robot, operator)
    confirm(door, door.post(*close_account(operator=operator)))
    closing = Change.objects.get()
    door.post(reverse("change-undo", args=[closing.pk]))
    assert state_of(booking) is State.BOOKED
    asked = door.post(reverse("people-erase"), {"person": operator.pk, "sure": "yes"})
    assert (asked.status_code, state_of(booking)) == (409, State.BOOKED)
    confirm(door, asked)
    assert state_of(booking) is State.CANCELLED
    assert (
        "stays erased"
        in door.post(reverse("change-undo", args=[Change.objects.latest("made_at").pk]), follow=True).text
    )
    operator.refresh_from_db()
    assert not operator.is_active


def test_an_account_that_was_closed_and_then_erased_stays_so(door, robot, operator, capsys, monkeypatch):
    book(robot, operator)
    monkeypatch.setattr(erase_person, "WRITTEN_S", 0.0)
    confirm(door, door.post(*close_account(operator=operator)))
    call_command("erase_person", operator.username, "--yes")
    late = door.post(reverse("change-undo", args=[Change.objects.get().pk]), follow=True)
    assert "stays erased" in late.text


def test_the_command_names_the_bookings_that_erasing_ends(robot, stranger, staff, capsys, monkeypatch):
    booking = book(robot, stranger, actor=staff, override="an open day")
    monkeypatch.setattr(erase_person, "WRITTEN_S", 0.0)
    monkeypatch.setattr("builtins.input", lambda _asked: "no")
    with pytest.raises(CommandError):
        call_command("erase_person", stranger.username)
    assert state_of(booking) is State.BOOKED
    call_command("erase_person", stranger.username, "--yes")
    assert "This ends a booking: TIAGo 1" in capsys.readouterr().out
    assert state_of(booking) is State.CANCELLED
    book(robot, staff)  # the slot is free


def test_another_group_with_other_hours_is_asked_for(door, robot, other_robot, operator):
    booking = book(robot, operator)
    group = RobotGroup.objects.create(name="Early", slug="early")
    group.robots.add(other_robot)
    door.post(
        reverse("booking-policy-group", args=["early"]), typed(**dict.fromkeys(WEEKDAYS, "01:00-02:00"))
    )
    form = {"entry": "early", "early-name": "Early", "early-robots": [robot.pk, other_robot.pk]}
    asked = door.post(reverse("robot-groups"), form)
    assert (asked.status_code, operator.display_name in asked.text) == (409, True)
    assert confirm(door, asked).status_code == 302
    assert state_of(booking) is State.CANCELLED


def test_a_supervisor_learns_no_robot_that_is_none_of_theirs(course, robot, other_robot, operator, stranger):
    course.supervisors.add(stranger)
    needed = Qualification.objects.create(name="Induction", slug="induction")
    needed.robots.set([robot, other_robot])
    QualificationGrant.objects.create(qualification=needed, person=operator)
    RobotRole.objects.create(user=operator, robot=other_robot, role=Role.OPERATOR)
    mine, hidden = book(robot, operator), book(other_robot, operator, days=3)
    desk = Client()
    desk.force_login(stranger)
    form = {"action": "revoke", "person": operator.pk, "qualification": "induction"}
    asked = desk.post(reverse("course-people", args=[course.slug]), form)
    assert robot.name in asked.text and other_robot.name not in asked.text
    assert "another robot, " in asked.text
    confirm(desk, asked)
    assert (state_of(mine), state_of(hidden)) == (State.CANCELLED, State.CANCELLED)
    assert other_robot.name not in desk.get(reverse("change", args=[Change.objects.get().pk])).text


def test_a_change_that_several_confirm_at_once_is_made_once(door, course, robot, operator, staff):
    booking = book(robot, operator)
    asked = door.post(*archive(course=course))
    fields = fields_of(asked)

    def press():
        desk = Client()
        desk.force_login(staff)
        assert desk.post(asked.request["PATH_INFO"], fields).status_code == 302

    assert all_at_once([press] * 4) == []
    assert (state_of(booking), Change.objects.count()) == (State.CANCELLED, 1)
    assert Notification.objects.count() == 1


def test_a_slot_that_a_grant_shortens_is_whole_again(door, course, robot, operator):
    needed = Qualification.objects.create(name="Induction", slug="induction")
    needed.robots.add(robot)
    QualificationGrant.objects.create(qualification=needed, person=operator)
    day = timezone.localdate() + timedelta(days=3)
    midnight = timezone.make_aware(datetime.combine(day, time()), timezone.get_default_timezone())
    slot = Slot(midnight - timedelta(hours=1), midnight + timedelta(hours=1))
    booking = booking_make(robot=robot, person=operator, slot=slot, now=timezone.now())
    form = {"action": "grant", "person": operator.pk, "qualification": "induction"}
    until = day - timedelta(days=1)
    asked = door.post(reverse("course-people", args=[course.slug]), {**form, "until": until})
    assert (asked.status_code, "shortened" in asked.text) == (409, True)
    confirm(door, asked)
    assert (state_of(booking), booking.ends_at) == (State.BOOKED, midnight)
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    assert (state_of(booking), booking.ends_at, booking.held_until) == (
        State.BOOKED,
        slot.ends_at,
        slot.ends_at,
    )


def test_a_slot_that_runs_ends_and_goes_on_after_the_undo(door, course, robot, operator):
    starts = timezone.now() - timedelta(minutes=5)
    times = {"starts_at": starts, "ends_at": starts + timedelta(hours=1), "used_at": starts}
    booking = Booking.objects.create(
        robot=robot, person=operator, **times, held_until=times["ends_at"], made_at=starts, course=course
    )
    asked = door.post(*archive(course=course))
    assert "ended" in asked.text
    confirm(door, asked)
    assert (state_of(booking), booking.held_until < booking.ends_at) == (State.FINISHED, True)
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    assert (state_of(booking), booking.held_until) == (State.BOOKED, booking.ends_at)


def test_a_supervisor_who_is_taken_out_of_a_course_is_asked_for(door, course, robot, stranger):
    course.supervisors.add(stranger)
    booking = book(robot, stranger)
    form = {"name": course.name, "robots": str(robot.pk), "role": "operator", "supervisors": ""}
    form |= {"starts_on": course.starts_on, "ends_on": course.ends_on}
    asked = door.post(reverse("course-edit", args=[course.slug]), form)
    assert (asked.status_code, stranger.display_name in asked.text) == (409, True)
    confirm(door, asked)
    assert state_of(booking) is State.CANCELLED
    door.post(reverse("change-undo", args=[Change.objects.get().pk]))
    assert state_of(booking) is State.BOOKED
    assert list(course.supervisors.all()) == [stranger]
