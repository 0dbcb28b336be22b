"""Fixtures: a fake bridge for the robot, a signed-in browser for each person."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator

import pytest
import pytest_asyncio

from fleet.accounts.models import User
from robots.link.client import links
from robots.registry.models import RobotRole
from teleop.background.database import in_database_background
from teleop.recording.repeat_suppression import RepeatSuppressor
from teleop.stop import emergency_stop
from tests.conftest import PASSWORD
from tests.teleop.support import FakeBridge, Page

OpenPage = Callable[..., Awaitable[Page]]


@pytest.fixture
def browsers(staff, supervisor, operator, observer, stranger, second_operator, signed_in):
    """Return the signed-in browser of each person, by user name."""
    people = [staff, supervisor, operator, observer, stranger, second_operator]
    return {person.username: signed_in(person) for person in people}


@pytest.fixture
def second_operator(robot):
    """Another operator of `robot`."""
    person = User.objects.create_user("second", password=PASSWORD, full_name="Olaf Operator")
    RobotRole.objects.create(robot=robot, user=person, role="operator")
    return person


@pytest.fixture(autouse=True)
def stop_log(monkeypatch) -> Iterator[None]:
    """Write the stops of a test during that test or not at all."""
    own = RepeatSuppressor(emergency_stop.write_record, most=None)
    monkeypatch.setattr(emergency_stop, "log", own)
    yield
    monkeypatch.setattr(own, "_write", lambda _last, _times: None)
    own.flush()
    in_database_background(lambda: None).result(
        10
    )  # wait for results too: nothing must be written during the next test


@pytest_asyncio.fixture
async def bridge(robot) -> AsyncIterator[FakeBridge]:
    """The bridge of `robot`."""
    running = await FakeBridge(robot).start()
    yield running
    await links.close()
    await running.close()


@pytest_asyncio.fixture
async def open_page(robot, browsers, websocket_headers, bridge) -> AsyncIterator[OpenPage]:
    """`await open_page("operator")`: that person's page of `robot`, which has said hello."""
    opened: list[Page] = []

    async def open_one(
        who: str, *, tab: str | None = None, slug: str = robot.slug, hello: bool = True
    ) -> Page:
        page = Page(websocket_headers(browsers[who]), f"/ws/robots/{slug}/")
        opened.append(page)
        await page.open()
        if hello:
            await page.say("hello", tab=tab or f"{who}-tab-0123456789")
            page.welcome = await page.hears("welcome")
            page.control = await page.hears("control")
        return page

    yield open_one
    for page in opened:
        await page.close()
