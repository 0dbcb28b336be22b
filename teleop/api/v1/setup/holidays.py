"""Holidays of the lab: days on which no robot can be booked."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from typing import Annotated
from uuid import UUID

from django.shortcuts import get_object_or_404
from msgspec import Meta, Struct

from fleet.bookings.changes.holidays import MOST, Entry, holiday_remove, holidays_add
from fleet.bookings.models import Holiday
from robots.access.selectors import lab_date
from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.setup.base import SetupView, faults_named, makes, manages


class HolidayRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """One holiday. `last_day` null: only one day."""

    name: Annotated[str, Meta(min_length=1, max_length=80)]
    first_day: date
    last_day: date | None = None


class HolidaysRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """New holidays. Those that are in the list already are left out."""

    holidays: Annotated[list[HolidayRequest], Meta(min_length=1, max_length=MOST)]


class HolidayEntry(Struct, frozen=True):
    """Days on which no robot can be booked, both included, in the lab's zone."""

    id: UUID
    name: str
    first_day: date
    last_day: date


class HolidayList(Struct, frozen=True):
    """Holidays that are not over, earliest first."""

    holidays: list[HolidayEntry]


class HolidaysView(SetupView):
    tag = "policies"

    @reads("holidays_list", "List holidays", refuses=())
    def get(self) -> HolidayList:
        """Holidays of the lab, from today on."""
        return _list(Holiday.objects.filter(last_day__gte=lab_date()))

    @makes(
        "holidays_add",
        "Add holidays",
        keyed=True,
        takes_time=True,
        refuses=(),
        examples={
            "Two": {
                "holidays": [
                    {"name": "Christmas", "first_day": "2026-12-24", "last_day": "2026-12-26"},
                    {"name": "New Year", "first_day": "2027-01-01"},
                ]
            }
        },
    )
    def post(self, body: HolidaysRequest) -> HolidayList:
        """For staff. The answer has those that were added. Bookings on these days are cancelled."""
        staff = self.staff()
        entries = [Entry(one.first_day, one.last_day or one.first_day, one.name) for one in body.holidays]
        with faults_named():
            return _list(holidays_add(entries, actor=staff))


class HolidayView(SetupView):
    tag = "policies"

    @manages("holidays_remove", "Remove a holiday")
    def delete(self, holiday_id: UUID) -> None:
        """For staff. Robots can be booked on these days again."""
        staff = self.staff()
        holiday_remove(holiday_id=get_object_or_404(Holiday, pk=holiday_id).pk, actor=staff)


def _list(found: Iterable[Holiday]) -> HolidayList:
    return HolidayList([entry_of(HolidayEntry, one) for one in found])
