"""Notifications reach the open pages of their person at once, whichever process wrote them."""

from __future__ import annotations

from datetime import timedelta

import pytest
import pytest_asyncio
from django.utils import timezone

from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.bookings.messages.notifications import notification_write, notifications_seen, passing_write
from teleop.background.database import in_database
from tests.teleop.support import Page

pytestmark = pytest.mark.django_db(transaction=True)


@pytest_asyncio.fixture
async def pages(browsers, websocket_headers):
    """Two pages of the operator and one of the observer; each has heard that there is nothing."""
    opened = [
        await Page(websocket_headers(browsers[who]), "/ws/news/").open()
        for who in ("operator", "operator", "observer")
    ]
    for page in opened:
        assert (await page.hears("news"))["items"] == []
    yield opened
    for page in opened:
        await page.close()


async def write(person):
    now = timezone.now()
    await in_database(notification_write, to=person, subject="Your turn", text="Now", now=now)


async def test_news_is_on_every_page_of_its_person_until_seen(pages, operator, observer):
    await write(operator)
    for page in pages[:2]:
        [item] = (await page.hears("news"))["items"]
        assert (item["subject"], item["path"], item["passing"]) == ("Your turn", "", False)
    await write(observer)
    assert len((await pages[2].hears("news"))["items"]) == 1  # and none of the operator's
    await in_database(notifications_seen, operator, item["number"], timezone.now())
    for page in pages[:2]:
        assert (await page.hears("news"))["items"] == []


async def test_a_notification_of_a_moment_disappears_when_it_is_over(pages, operator):
    now = timezone.now()
    moment = {"path": "/robots/tiago-1/", "until": now + timedelta(seconds=2)}
    await in_database(passing_write, to=operator, subject="Your turn", text="Now", now=now, **moment)
    [item] = (await pages[0].hears("news"))["items"]
    assert (item["path"], item["passing"]) == ("/robots/tiago-1/", True)
    assert (await pages[0].hears("news"))["items"] == []


async def test_a_page_of_a_person_who_signs_out_gets_nothing_more(pages, browsers):
    await in_database(browsers["operator"].logout)
    assert await pages[0].is_closed() == 4401


async def test_a_program_gets_no_notifications(operator):
    expires = timezone.now() + timedelta(days=1)
    _token, text = await in_database(
        token_make, user=operator, name="program", scopes=[Scope.READ], expires_at=expires, actor=operator
    )
    page = await Page([(b"authorization", f"Bearer {text}".encode())], "/ws/news/").open()
    assert await page.is_closed() == 4403
