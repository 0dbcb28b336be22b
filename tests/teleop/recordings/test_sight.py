"""The parts of a recording that each person sees, and the right to change it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from itertools import count
from typing import Any

import pytest

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.access.models import Course, Enrolment
from robots.access.selectors import lab_date
from robots.recordings.models import Place, Recording
from robots.registry.models import Robot
from robots.shared.wire import NotDone
from teleop.models import ControlSession
from teleop.recordings import services
from teleop.recordings.selectors import Part, recordings_of, recordings_of_session, sight_of

pytestmark = pytest.mark.django_db
BEGAN = datetime(2026, 11, 2, 9, 0, tzinfo=UTC)
_fences = count(1)


def at(minute: float) -> datetime:
    return BEGAN + timedelta(minutes=minute)


def session(robot: Robot, user: User, begins: float, ends: float) -> ControlSession:
    return ControlSession.objects.create(
        robot=robot, user=user, fence=next(_fences), started_at=at(begins), ended_at=at(ends)
    )


@pytest.fixture
def recorded(robot: Robot) -> Callable[..., Recording]:
    def make(begins: float = 0, ends: float = 30, **given: Any) -> Recording:
        return Recording.objects.create(
            robot=robot, kind="by_hand", begins_at=at(begins), ends_at=at(ends), file="a.mcap", **given
        )

    return make


@pytest.fixture
def course(robot: Robot, operator: User, second_operator: User) -> Course:
    today = lab_date()
    course = Course.objects.create(name="HRI", slug="hri", starts_on=today, ends_on=today)
    course.robots.add(robot)
    for person in (operator, second_operator):
        Enrolment.objects.create(course=course, person=person)
    return course


def test_an_owner_alone_in_it_sees_and_changes_all(recorded: Any, robot: Robot, operator: User) -> None:
    recording = recorded(person=operator)
    session(robot, operator, 0, 30)
    sight = sight_of(operator, recording)
    assert sight is not None and sight.whole and sight.may_change
    assert list(recordings_of(operator)) == [recording]


def test_each_student_sees_the_time_of_their_own_sessions(
    recorded: Any, robot: Robot, operator: User, second_operator: User, stranger: User, observer: User
) -> None:
    recording = recorded(person=operator)
    mine, theirs = session(robot, operator, -5, 10), session(robot, second_operator, 10, 40)
    session(robot, operator, 50, 60)
    sight = sight_of(operator, recording)
    assert sight is not None and not sight.whole and not sight.may_change
    assert sight.parts == [Part(at(0), at(10))]
    other = sight_of(second_operator, recording)
    assert other is not None and other.parts == [Part(at(10), at(30))]
    assert sight.part_at(at(5)) and not sight.part_at(at(11))
    assert list(recordings_of(second_operator)) == [recording]
    for person in (stranger, observer):
        assert sight_of(person, recording) is None and not recordings_of(person).exists()
    assert list(recordings_of_session(mine)) == list(recordings_of_session(theirs)) == [recording]


def test_the_clock_of_the_file_says_who_had_control_when(
    recorded: Any, robot: Robot, operator: User, second_operator: User
) -> None:
    mine, theirs = (
        session(robot, operator, 2, 12),
        session(robot, second_operator, 12, 40),
    )  # two minutes late
    controls = [
        {"session": str(one.pk), "begins": at(begins).timestamp(), "ends": at(ends).timestamp()}
        for one, begins, ends in ((mine, 0, 10), (theirs, 10, 20), (mine, 20, 25))
    ]
    recording = recorded(controls=controls)
    sights = [sight_of(person, recording) for person in (operator, second_operator)]
    assert [sight and sight.parts for sight in sights] == [
        [Part(at(0), at(10)), Part(at(20), at(25))],
        [Part(at(10), at(20))],
    ]
    assert sight_of(second_operator, recorded(controls=controls[:1])) is None


def test_staff_and_supervisors_see_all(
    recorded: Any, robot: Robot, operator: User, staff: User, supervisor: User
) -> None:
    recording = recorded()
    session(robot, operator, 0, 30)
    for person in (staff, supervisor):
        sight = sight_of(person, recording)
        assert sight is not None and sight.whole and sight.may_change and recordings_of(person).exists()


def test_a_supervisor_of_the_course_sees_its_lesson(recorded: Any, course: Course, stranger: User) -> None:
    recording = recorded(course="hri")
    assert sight_of(stranger, recording) is None
    course.supervisors.add(stranger)
    sight = sight_of(stranger, recording)
    assert sight is not None and sight.whole and list(recordings_of(stranger)) == [recording]


def test_a_share_shows_all_until_it_ends(
    recorded: Any, robot: Robot, course: Course, operator: User, second_operator: User, stranger: User
) -> None:
    recording = recorded(person=operator)
    session(robot, operator, 0, 30)
    share = services.recording_share(recording=recording, actor=operator, course=course)
    services.recording_share(recording=recording, actor=operator, course=course)  # twice is once
    sight = sight_of(second_operator, recording)
    assert sight is not None and sight.whole and not sight.may_change
    with pytest.raises(NotDone, match="owner"):
        services.recording_delete(recording=recording, actor=second_operator)
    assert sight_of(stranger, recording) is None
    services.recording_unshare(share=share, actor=operator)
    assert sight_of(second_operator, recording) is None
    kinds = Record.objects.filter(kind__startswith="recording.").order_by("pk").values_list("kind", flat=True)
    assert list(kinds) == ["recording.share", "recording.unshare"]


def test_a_deleted_recording_is_there_for_nobody(
    recorded: Any, robot: Robot, operator: User, staff: User
) -> None:
    recording = recorded(person=operator)
    services.recording_keep(recording=recording, keep=True, actor=operator)
    services.recording_delete(recording=recording, actor=operator)
    recording.refresh_from_db()
    assert recording.place == Place.GONE and recording.kept_at is not None
    assert sight_of(staff, recording) is None and not recordings_of(staff).exists()
    with pytest.raises(NotDone, match="no such"):
        services.recording_keep(recording=recording, keep=True, actor=staff)


def test_an_account_that_was_closed_sees_nothing(recorded: Any, operator: User) -> None:
    recording = recorded(person=operator)
    operator.is_active = False
    assert sight_of(operator, recording) is None and not recordings_of(operator).exists()
