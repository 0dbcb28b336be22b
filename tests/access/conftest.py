"""Fixtures: a course of this year, and its supervisor."""

from __future__ import annotations

from datetime import timedelta

import pytest

from fleet.accounts.models import User
from robots.access.models import Course, Enrolment
from robots.access.selectors import lab_date
from robots.registry.models import Robot
from tests.conftest import PASSWORD


@pytest.fixture
def teacher(db: None) -> User:
    return User.objects.create_user("teacher", password=PASSWORD, full_name="Tea Cher")


@pytest.fixture
def student(db: None) -> User:
    return User.objects.create_user("student", password=PASSWORD, full_name="Stu Dent")


@pytest.fixture
def course(robot: Robot, teacher: User, student: User) -> Course:
    """A course on `robot`, valid today, of `student` and `teacher`."""
    today = lab_date()
    course = Course.objects.create(
        name="HRI 2026", slug="hri-2026", starts_on=today, ends_on=today + timedelta(days=90)
    )
    course.robots.add(robot)
    course.supervisors.add(teacher)
    Enrolment.objects.create(course=course, person=student)
    return course
