"""The use of the robots by the people of a course, for programs that give marks."""

from __future__ import annotations

from django.utils import timezone
from msgspec import Struct

from teleop.api.v1.courses import CoursesBase
from teleop.api.v1.setup.base import manages
from teleop.reports.marks import Mark, marks_exported


class MarkList(Struct, frozen=True):
    """The figures of everybody in a course, by name."""

    marks: list[Mark]


class MarksView(CoursesBase):
    @manages("courses_marks", "Read what each person of a course did in it")
    def get(self, slug: str) -> MarkList:
        """Everybody who is enrolled, also without any drive. The page has the same as CSV. Recorded."""
        return MarkList(marks_exported(self.course(slug), self.person, timezone.now()))
