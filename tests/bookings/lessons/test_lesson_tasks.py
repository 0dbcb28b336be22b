"""The tasks that a lesson leaves to its members, and students spread over its robots."""

from datetime import timedelta

import pytest

from fleet.audit.models import Record
from fleet.bookings.changes.series import series_make, weekly
from fleet.bookings.lessons import turns
from fleet.bookings.lessons.tasks import lesson_tasks_set, tasks_of
from fleet.bookings.lessons.together import at_once, line_spread
from fleet.bookings.rules import Slot
from fleet.bookings.services import BookingRefused, booking_make
from robots.access.models import Enrolment
from robots.records.faults import ROBOT, Condition, record_part
from robots.shared.wire import LessonTasks
from teleop.control.rules import permit_for
from teleop.control.selectors import subject_of
from tests.bookings.lessons.conftest import at

pytestmark = pytest.mark.django_db(transaction=True)


def choose(lesson, actor, **tasks):
    booking = getattr(lesson, "lesson", lesson)
    options = {name: tasks.pop(name) for name in ("whole_series",) if name in tasks}
    given = LessonTasks(**tasks)
    return lesson_tasks_set(booking_id=booking.pk, tasks=given, actor=actor, now=at(1), **options)


def share_of(lesson, person):
    return permit_for(subject_of(person, lesson.robot, at(1))).max_share


def test_members_drive_no_faster_than_the_lesson_and_its_teacher_does(lesson, students, teacher, supervisor):
    Enrolment.objects.create(course=lesson.course, person=supervisor)  # stays a supervisor
    lesson.take(students[0], 0.5)
    choose(lesson, teacher, max_share=0.4)
    assert share_of(lesson, students[0]) == 0.4
    assert share_of(lesson, teacher) == share_of(lesson, supervisor) == 1.0
    assert Record.objects.filter(kind="booking.tasks", actor=teacher.pk).exists()


def test_members_who_only_watch_get_neither_control_nor_a_turn(lesson, students, teacher):
    ada, ben, _cem = students
    lesson.join(ada)
    choose(lesson, teacher, watch=True)
    assert lesson.refused(ben, 1).code == "only_watching"
    with pytest.raises(BookingRefused, match="you watch"):
        lesson.join(ben, minute=1)
    lesson.settle(1)
    assert lesson.turns == [("ada", "refused")]
    lesson.take(teacher, 1)


def test_only_who_leads_a_lesson_chooses_its_tasks(lesson, students, robot, operator):
    with pytest.raises(BookingRefused, match="Only the owner"):
        choose(lesson, students[0], max_share=1.0)
    slot = Slot(at(180), at(240))
    own = booking_make(robot=robot, person=operator, slot=slot, now=at(0))
    with pytest.raises(BookingRefused, match="Only a booking for a course"):
        choose(own, operator, max_share=0.5)


def test_the_tasks_are_copied_to_later_dates_of_the_series(robot, course, teacher):
    first = Slot(at(0) + timedelta(days=1), at(60) + timedelta(days=1))
    made, _left = series_make(
        robot=robot,
        person=teacher,
        actor=teacher,
        slots=weekly(first, 3, []),
        purpose="SLAM",
        override="",
        now=at(0),
        course=course,
        turn_min=5,
    )
    assert len(made) == 3
    assert choose(made[1], teacher, phrases=["Hello"], whole_series=True) == 2
    shares = []
    for booking in made:
        booking.refresh_from_db()
        shares.append(tasks_of(booking).phrases)
    assert shares == [[], ["Hello"], ["Hello"]]
    assert choose(made[1], teacher) == 1  # everything again: for this date only
    made[1].refresh_from_db()
    assert made[1].tasks is None


def test_students_are_spread_evenly_over_the_robots_of_a_lesson(
    lesson, students, teacher, other_robot, course, django_user_model
):
    ada, ben, cem = students
    course.robots.add(other_robot)
    slot = Slot(at(0), at(120))
    second = booking_make(
        robot=other_robot, person=teacher, slot=slot, now=at(-60), lesson_of=course, turn_min=10
    )
    assert [one.robot for one in at_once(second)] == [lesson.robot, other_robot]
    lesson.join(ada, ben)
    turns.turn_join(booking_id=second.pk, person=ada, now=at(0))  # ada stands in both lines
    lesson.take(ada, 0.5)
    assert line_spread(booking_id=lesson.lesson.pk, actor=teacher, now=at(1)) == 3
    assert lesson.turns == [("ada", "driving"), ("cem", "waiting")]
    assert [turn.person.username for turn in second.turns.all()] == ["ben"]
    with pytest.raises(BookingRefused, match="Only the owner"):
        line_spread(booking_id=second.pk, actor=cem, now=at(1))
    record_part(other_robot.pk, ROBOT, Condition("robot_offline", "off"))
    assert line_spread(booking_id=lesson.lesson.pk, actor=teacher, now=at(2)) == 3
    assert lesson.turns == [("ada", "driving"), ("ben", "waiting"), ("cem", "waiting")]


def test_an_enrolled_supervisor_of_the_course_is_no_student(lesson, teacher, course, django_user_model):
    second = django_user_model.objects.create_user("second")
    course.supervisors.add(second)
    Enrolment.objects.create(course=course, person=second)
    choose(lesson, teacher, max_share=0.4)
    assert share_of(lesson, second) == 1.0
    choose(lesson, teacher, watch=True)
    assert share_of(lesson, second) == 1.0
