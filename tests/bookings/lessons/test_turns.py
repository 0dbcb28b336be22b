"""Turns in a lesson: who may drive, who is called next, and what ends a turn. The slot stays the teacher's."""

from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.hours.report import report
from fleet.bookings.lessons import turns
from fleet.bookings.lessons.robots import why_nobody_is_called
from fleet.bookings.lessons.standings import standings
from fleet.bookings.models import Booking, Notification, OutOfService, State, Waiting
from fleet.bookings.rules import Slot, refusals
from fleet.bookings.schedule import schedule_of
from fleet.bookings.selectors import wish_of
from fleet.bookings.services import BookingRefused, booking_cancel, booking_move, store_no_shows
from robots.access.enrolment import unenrol
from robots.records.faults import ROBOT, Condition, record_part
from teleop.control import selectors, services
from teleop.control.selectors import control_status, lease_of
from teleop.control.waiting import line
from teleop.control.waiting.turns import turns_settle
from teleop.models import EndReason, Lease
from tests.bookings.lessons.conftest import at, tab

pytestmark = pytest.mark.django_db(transaction=True)


def code(step, **options):
    with pytest.raises(BookingRefused) as caught:
        step(**options)
    return caught.value.refusal.code


def test_turns_go_by_the_line_and_end_by_themselves(lesson, students, teacher):
    ada, ben, cem = students
    lesson.join(ada, ben, cem, minute=-10)
    assert lesson.settle(0)
    assert lesson.turns == [("ada", "called"), ("ben", "waiting"), ("cem", "waiting")]
    refusal = lesson.refused(cem, 0.5)
    assert (refusal.code, refusal.figures) == (
        "not_your_turn",
        {"driver": "ada", "place": 2, "minutes": 20},
    )
    assert "number 2 in line, in about 20 min" in refusal.text
    assert lesson.take(ada, 1).term_ends_at == at(11)
    assert lease_of(lesson.robot.pk).user == ada.pk
    assert not lesson.settle(5)
    lesson.expire(11)
    assert lesson.settle(11)
    assert lesson.turns == [("ada", "done"), ("ben", "called"), ("cem", "waiting")]
    assert lesson.refused(ada, 11).code == "not_your_turn"
    lesson.take(ben, 11.1)
    lesson.end(EndReason.RELEASED, 13, by=ben)
    assert lesson.settle(13)
    assert lesson.turn.person == cem
    lesson.lesson.refresh_from_db()
    assert (lesson.lesson.person, lesson.lesson.ends_at) == (teacher, at(120))
    assert Booking.objects.count() == 1


@pytest.mark.parametrize("minute", [10.001, 9.9])  # the turn is over; the page is back after its lease ended
def test_nobody_drives_on_by_taking_control_before_the_end_is_stored(lesson, students, minute):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.settle(0)
    lesson.take(ada, 0)
    Lease.objects.update(seen_at=at(9.5))
    assert lesson.refused(ada, minute).code == "not_your_turn"
    services.lease_expire(robot_id=lesson.robot.pk, now=at(minute))
    lesson.settle(minute)
    assert lesson.turns == [("ada", "done"), ("ben", "called")]


def test_the_line_says_who_has_no_time_left_in_the_lesson(lesson, students):
    lesson.join(*students[:3], minute=105)
    assert [one.in_time for one in standings(lesson.lesson, at(105))] == [True, True, False]


def test_strangers_are_told_until_when_and_by_which_course(lesson, operator, supervisor):
    refusal = lesson.refused(operator, 1)
    assert (refusal.code, refusal.figures["holder"]) == ("booked", "HRI 2026")
    assert refusal.text == "HRI 2026 has a lesson on this robot until 11:00. Book another time."
    assert lesson.refused(supervisor, 1).code == "booked"
    assert code(turns.turn_join, booking_id=lesson.lesson.pk, person=operator, now=at(1)) == "not_in_lesson"


def test_with_nobody_in_line_a_student_just_takes_control(lesson, students):
    ada, ben, _cem = students
    assert lesson.take(ada, 1).term_ends_at == at(11)
    assert lesson.turns == [("ada", "driving")]
    assert lesson.refused(ben, 2).code == "not_your_turn"
    lesson.expire(11)
    lesson.join(ben, minute=11)
    lesson.settle(11)
    assert lesson.turn.person == ben


def test_who_read_the_clock_before_the_call_notes_no_miss(lesson, students):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.settle(5)
    assert not lesson.settle(4.9)  # waited for the robot's lock meanwhile
    assert lesson.turns == [("ada", "called"), ("ben", "waiting")] and lesson.turn.misses == 0
    assert schedule_of(lesson.robot, at(4.9)).current.turn.call_left_s(at(4.9)) == 90
    assert lesson.settle(3)  # the clock is set back
    assert lesson.turn.person == ben


def test_who_does_not_come_goes_one_place_back_once(lesson, students):
    ada, ben, cem = students
    lesson.join(ada, ben, cem)
    lesson.settle(0)
    assert not lesson.settle(1.4)
    assert lesson.settle(1.5)  # 90 s
    assert lesson.turns == [("ben", "called"), ("ada", "waiting"), ("cem", "waiting")]
    lesson.take(ben, 2)
    lesson.end(EndReason.RELEASED, 3, by=ben)
    lesson.settle(3)
    assert lesson.turn.person == ada
    lesson.settle(4.5)
    assert lesson.turns == [("ben", "done"), ("ada", "missed"), ("cem", "called")]
    lesson.join(ada, minute=5)  # may come again, as the last
    assert lesson.turns[-1] == ("ada", "waiting")


def test_the_teacher_takes_over_and_gives_back(lesson, students, teacher):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.settle(0)
    lesson.take(ada, 0)
    lesson.settle(4)
    over = lesson.take(teacher, 4, services.lease_take_over, reason="")
    assert over.term_ends_at == at(120)
    assert lesson.turns == [("ada", "waiting"), ("ben", "waiting")]
    assert not lesson.settle(5)
    lesson.end(EndReason.RELEASED, 6, by=teacher)
    lesson.settle(6)
    assert lesson.turn.person == ada
    assert lesson.take(ada, 6.5).term_ends_at == at(12.5)  # the six minutes that were left


def test_a_supervisor_takes_over_without_a_reason_no_student(lesson, students, supervisor, operator):
    ada, ben, _cem = students
    lesson.take(ada, 0)
    assert lesson.refused(ben, 1, services.lease_take_over, reason="I want to").code in (
        "not_your_turn",
        "role_too_low",
    )
    lesson.take(supervisor, 1, services.lease_take_over, reason="")
    assert lease_of(lesson.robot.pk).user == supervisor.pk


def test_the_teacher_hands_over_to_whom_they_choose(lesson, students, teacher):
    ada, ben, cem = students
    lesson.take(teacher, 0)
    for person in (ada, ben):
        line.line_join(robot_id=lesson.robot.pk, user_id=person.pk, tab=tab(person), now=at(0.1))
    assert lesson.turns == [("ada", "waiting"), ("ben", "waiting")]  # who asks in a lesson joins its line
    assert not Waiting.objects.exists()
    turns.turn_call(booking_id=lesson.lesson.pk, username="cem", actor=teacher, now=at(1))
    assert lesson.turns == [("cem", "waiting"), ("ada", "waiting"), ("ben", "waiting")]
    lesson.end(EndReason.RELEASED, 2, by=teacher)
    lesson.settle(2)
    assert lesson.turn.person == cem
    line.line_leave(robot_id=lesson.robot.pk, user_id=ben.pk, connection="", now=at(3))
    assert lesson.turns[-1] == ("ben", "skipped")


def test_call_skip_extend_and_hold_are_the_teachers(lesson, students, teacher):
    ada, ben, cem = students
    lesson.join(ada, ben, cem)
    lesson.settle(0)
    asked = {"booking_id": lesson.lesson.pk, "now": at(0.2)}
    turn_id = lesson.turn.pk
    for step, options in (
        (turns.turn_call, {"username": "ben"}),
        (turns.turn_skip, {"turn_id": turn_id}),
        (turns.turn_extend, {"turn_id": turn_id, "minutes": 5}),
        (turns.line_hold, {"hold": True}),
        (turns.line_fill, {}),
    ):
        assert code(step, actor=ada, **asked, **options) == "not_teacher"
    turns.turn_call(username="cem", actor=teacher, **asked)
    lesson.settle(0.3)
    assert lesson.turns == [("cem", "called"), ("ada", "waiting"), ("ben", "waiting")]
    lesson.take(cem, 0.5)
    turns.turn_extend(turn_id=lesson.turn.pk, minutes=5, actor=teacher, **asked)
    assert lesson.turn.ends_at == at(15.5)
    turns.line_hold(hold=True, actor=teacher, **asked | {"now": at(5.5)})
    assert lesson.turns == [("cem", "waiting"), ("ada", "waiting"), ("ben", "waiting")]
    lesson.end(EndReason.RIGHT, 5.6)  # as the hub does
    assert not lesson.settle(6)
    assert "holds the line" in lesson.refused(ada, 6).text
    turns.turn_skip(turn_id=lesson.lesson.turns.get(person=cem).pk, actor=teacher, **asked)
    turns.line_hold(hold=False, actor=teacher, **asked | {"now": at(7)})
    lesson.settle(7)
    assert lesson.turn.person == ada
    kinds = set(Record.objects.filter(kind__startswith="turn.").values_list("kind", flat=True))
    assert kinds >= {"turn.join", "turn.call", "turn.extend", "turn.hold", "turn.skip", "turn.go_on"}


def test_a_skipped_driver_loses_control(lesson, students, teacher):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.take(ada, 0)
    turns.turn_skip(booking_id=lesson.lesson.pk, turn_id=lesson.turn.pk, actor=teacher, now=at(2))
    [rights] = rights_of_people(lesson, [ada], 2)
    assert rights.permit.code == "not_your_turn"  # the hub ends control then


def rights_of_people(lesson, people, minute):
    sign_ins = [(person.pk, f"key-{person.pk}") for person in people]
    found = dict.fromkeys(sign_ins)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(selectors, "signed_in", lambda _asked: dict(zip(sign_ins, people, strict=True)))
        status = control_status(lesson.robot.pk, people=sign_ins, sessions=[], now=at(minute))
    return [status.rights[one] for one in found]


def test_a_phone_that_sleeps_keeps_the_rest_of_the_turn(lesson, students):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.take(ada, 0)
    Lease.objects.update(seen_at=at(3))
    services.lease_expire(robot_id=lesson.robot.pk, now=at(3.5))  # away
    lesson.settle(3.5)
    assert lesson.turn.person == ada
    assert lesson.turn.left_s == 390
    lesson.settle(5)
    assert lesson.turn.person == ben  # ada did not come back within 90 s


def test_a_restart_in_the_middle_of_a_lesson_goes_on_with_the_line(lesson, students):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.take(ada, 0)
    services.lease_expire(
        robot_id=lesson.robot.pk, now=at(30)
    )  # nobody saw ada's page; her term is over, too
    lesson.settle(30)
    assert lesson.turns == [("ada", "done"), ("ben", "called")]


def test_no_turn_outlives_the_slot(lesson, students, teacher):
    ada, ben, _cem = students
    lesson.take(teacher, 0)
    lesson.end(EndReason.RELEASED, 1, by=teacher)
    lesson.join(ada, ben, minute=114)
    assert lesson.take(ada, 115).term_ends_at == at(120)
    lesson.expire(120)
    assert not lesson.settle(120)
    assert lesson.turns == [("ada", "done"), ("ben", "waiting")]
    assert code(turns.turn_join, booking_id=lesson.lesson.pk, person=ada, now=at(121)) == "over"


def test_who_is_unenrolled_loses_the_turn_and_the_next_is_called(lesson, students, course, staff):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.take(ada, 0)
    unenrol(course=course, people=[ada], actor=staff)
    [rights] = rights_of_people(lesson, [ada], 1)
    assert rights.permit.code in ("role_too_low", "no_role")
    lesson.end(EndReason.RIGHT, 1)
    lesson.settle(1)
    assert lesson.turns == [("ada", "refused"), ("ben", "called")]


def test_nobody_is_called_while_the_robot_is_out_of_service(lesson, students):
    ada, *_others = students
    lesson.join(ada, minute=-5)
    period = OutOfService.objects.create(robot=lesson.robot, starts_at=at(-1), why="repair")
    assert not lesson.settle(1)
    period.delete()
    assert lesson.settle(2)


def test_in_an_archived_course_nobody_is_called(lesson, students, course):
    ada, *_others = students
    lesson.join(ada, minute=-5)
    course.archived = True
    course.save()
    lesson.settle(1)
    assert lesson.turns == [("ada", "refused")]


def test_more_time_lengthens_a_turn_while_nobody_waits(lesson, students):
    ada, ben, _cem = students
    lesson.take(ada, 0)
    renew = {"robot_id": lesson.robot.pk, "user_id": ada.pk, "tab": tab(ada), "now": at(1)}
    Lease.objects.update(seen_at=at(1))
    services.lease_renew(**renew)
    assert (lesson.turn.ends_at, lease_of(lesson.robot.pk).term_ends_at) == (at(20), at(20))
    lesson.join(ben, minute=1)
    with pytest.raises(services.ControlRefused) as caught:
        services.lease_renew(**renew)
    assert caught.value.refusal.code == "somebody_waits"


def test_a_call_marks_the_lesson_as_used(lesson, students):
    lesson.join(students[0], minute=-5)
    lesson.settle(10)
    lesson.lesson.refresh_from_db()
    assert lesson.lesson.used_at == at(10)


def test_the_line_is_filled_with_everybody_by_name(lesson, students, teacher):
    lesson.join(students[1])
    assert turns.line_fill(booking_id=lesson.lesson.pk, actor=teacher, now=at(-1)) == 2
    assert [name for name, _state in lesson.turns] == ["ben", "ada", "cem"]


def test_when_the_teachers_page_closes_the_line_goes_on(lesson, students, teacher):
    ada, *_others = students
    lesson.join(ada)
    lesson.take(teacher, 0)
    services.lease_expire(robot_id=lesson.robot.pk, now=at(1))  # away
    assert turns_settle(robot_id=lesson.robot.pk, now=at(1))
    assert lesson.turn.person == ada


def test_a_period_out_of_service_interrupts_a_turn(lesson, students):
    ada, *_others = students
    OutOfService.objects.create(robot=lesson.robot, starts_at=at(5), ends_at=at(15), why="battery")
    assert lesson.take(ada, 0).term_ends_at == at(5)
    lesson.expire(5)
    assert lesson.turns == [("ada", "waiting")]
    assert lesson.settle(15)
    assert lesson.take(ada, 15).term_ends_at == at(20)


def test_of_lessons_that_move_soon_its_people_are_told(lesson, students, teacher):
    seen = {"booking_id": lesson.lesson.pk, "actor": teacher, "now": at(-60)}
    booking_move(version=1, slot=Slot(at(60), at(180)), **seen)
    booking_cancel(version=2, **seen)
    told = Notification.objects.values_list("person__username", "subject")
    assert sorted(told) == [
        (name, f"Your booking of TIAGo 1: {what}")
        for name in ("ada", "ben", "cem")
        for what in ("cancelled", "moved")
    ]


@pytest.mark.parametrize(("count", "codes"), [("nobody", []), ("drivers", ["quota_course_day"])])
def test_lesson_time_counts_for_nobody_or_for_who_drove(count, codes, lesson, students, course):
    ada, ben, _cem = students
    course.day_min, course.lessons_count = 60, count
    course.save()
    lesson.take(ada, 0)
    lesson.expire(10)
    slot = Slot(at(180), at(235))
    for person, expected in ((ada, codes), (ben, [])):
        wish = wish_of(robot=lesson.robot, person=person, slot=slot, now=at(121))
        assert [one.code for one in refusals(wish)] == expected


def test_the_report_gives_the_hours_to_who_drove(lesson, students, course):
    lesson.take(students[0], 0)
    lesson.expire(10)
    span = {"starts": at(-60), "ends": at(600), "now": at(200)}
    [row] = report([lesson.robot], (), by="person", **span)
    assert (row.name, row.bookings, row.booked_h, row.used_h) == ("ada", 0, 0.0, pytest.approx(1 / 6))
    assert report([lesson.robot], (), by="person", whose="ben", **span) == []
    [row] = report((), [course], by="course", **span)
    assert (row.name, row.bookings, row.used_h) == ("HRI 2026", 1, 2.0)


def goes_offline(robot, why="robot_offline"):
    record_part(robot.pk, ROBOT, Condition(why, why))


@pytest.mark.parametrize("somebody_waits", [True, False])
def test_who_waits_for_a_robot_that_is_offline_keeps_the_slot(lesson, students, somebody_waits):
    if somebody_waits:
        lesson.join(students[0])
    goes_offline(lesson.robot)
    assert not lesson.settle(1)
    store_no_shows(at(30), timedelta(hours=2))
    assert Booking.objects.get().state == (State.BOOKED if somebody_waits else State.NO_SHOW)


@pytest.mark.parametrize("offline", [True, False])
def test_a_call_to_a_robot_that_nobody_can_drive_is_taken_back(lesson, students, offline):
    ada, ben, _cem = students
    lesson.join(ada, ben)
    lesson.settle(0)
    if offline:
        goes_offline(lesson.robot)
    else:
        period = OutOfService.objects.create(robot=lesson.robot, starts_at=at(0.5), why="repair")
    assert lesson.settle(1)
    assert lesson.turns == [("ada", "waiting"), ("ben", "waiting")]
    assert not lesson.settle(3)  # nobody missed a call
    assert Record.objects.filter(kind="turn.wait").count() == 1
    if offline:
        goes_offline(lesson.robot, "")  # it is back
    else:
        period.delete()
    assert lesson.settle(4)
    assert lesson.turns == [("ada", "called"), ("ben", "waiting")]
    assert lesson.turn.misses == 0


def test_the_page_says_why_nobody_is_called(lesson, students, teacher, signed_in, robot):
    now = timezone.now()
    Booking.objects.update(
        starts_at=now, ends_at=now + timedelta(hours=1), held_until=now + timedelta(hours=1)
    )
    address, browser = reverse("lesson", args=[lesson.lesson.pk]), signed_in(teacher)
    assert address in browser.get(reverse("bookings-course", args=["hri"])).content.decode()
    for student in students[:2]:
        turns.turn_join(booking_id=lesson.lesson.pk, person=student, now=now)
    text = browser.get(address).content.decode()
    assert 'data-part="why"' not in text
    assert '"quiet">about' in text
    goes_offline(robot)
    text = browser.get(address).content.decode()
    assert "The robot is offline: nobody is called" in text
    assert '"quiet">about' not in text
    OutOfService.objects.create(robot=robot, starts_at=now, why="repair", note="wheel")
    assert ": wheel): nobody is called" in browser.get(address).content.decode()


def test_a_robot_that_is_off_before_the_lesson_is_no_reason(lesson, robot):
    goes_offline(robot)
    assert not why_nobody_is_called(lesson.lesson, at(-30))
    assert why_nobody_is_called(lesson.lesson, at(0))
