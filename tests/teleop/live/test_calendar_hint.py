"""The calendar is notified of changes that any process made."""

import pytest
import pytest_asyncio
from django.urls import reverse
from django.utils import timezone

from fleet.bookings.changes.policy_changes import out_of_service_add
from fleet.bookings.models import OutOfService
from teleop.background.database import in_database
from tests.bookings.test_pages import JSON, fields
from tests.teleop.support import Page

pytestmark = pytest.mark.django_db(transaction=True)


@pytest_asyncio.fixture
async def calendar(browsers, websocket_headers):
    page = await Page(websocket_headers(browsers["observer"]), "/ws/bookings/").open()
    for _ in range(2):  # when it opens, and when the console begins to check
        await page.hears("bookings_changed")
    yield page
    await page.close()


async def test_a_booking_of_another_person_is_heard_of(calendar, browsers, robot):
    await in_database(browsers["operator"].post, reverse("booking-new"), fields(robot), **JSON)
    await calendar.hears("bookings_changed")


async def test_a_robot_out_of_service_is_heard_of(calendar, robot, staff):
    now = timezone.now()
    period = {"starts_at": now, "ends_at": None, "why": OutOfService.Why.REPAIR, "note": ""}
    await in_database(out_of_service_add, robot=robot, **period, actor=staff, now=now)
    await calendar.hears("bookings_changed")
