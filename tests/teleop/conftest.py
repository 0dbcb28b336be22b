"""Fixtures: a fake bridge for the robot, a signed-in browser for each person."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from functools import partial

import pytest
import pytest_asyncio
from django.test import Client
from msgspec import structs

from fleet.accounts.models import User
from robots.link.client import links
from robots.registry.models import RobotRole
from robots.shared.configuration.bridge_config import Allowed
from teleop.background.database import in_database_background
from teleop.control import selectors
from tests.conftest import PASSWORD
from tests.teleop.support import FakeBridge, Page

OpenPage = Callable[..., Awaitable[Page]]
FIXTURES = {"second": "second_operator"}  # other people's fixtures have their user names


@pytest.fixture
def browsers(request: pytest.FixtureRequest, signed_in: Callable[[User], Client]) -> Browsers:
    """Return the signed-in browser of each person, by user name."""
    return Browsers(request.getfixturevalue, signed_in)


class Browsers(dict[str, Client]):
    """People's browsers. The test's first use makes the account and signs in: both take longer than most tests."""

    def __init__(self, fixture: Callable[[str], User], signed_in: Callable[[User], Client]) -> None:
        super().__init__()
        self._fixture = fixture
        self._signed_in = signed_in

    def __missing__(self, username: str) -> Client:
        # Django refuses database calls in the event loop's thread.
        if _in_event_loop():
            browser = in_database_background(partial(self._sign_in, username)).result(10)
        else:
            browser = self._sign_in(username)
        self[username] = browser
        return browser

    def _sign_in(self, username: str) -> Client:
        return self._signed_in(self._fixture(FIXTURES.get(username, username)))


def _in_event_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


@pytest_asyncio.fixture
async def bridge(robot) -> AsyncIterator[FakeBridge]:
    """The bridge of `robot`."""
    running = await FakeBridge(robot).start()
    yield running
    await links.close()
    await running.close()


@pytest_asyncio.fixture
async def open_page(robot, browsers, websocket_headers, bridge) -> AsyncIterator[OpenPage]:
    """`await open_page("operator")`: that person's page of `robot`, after its hello message."""
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


@pytest.fixture
async def holder(open_page: OpenPage) -> Page:
    """The operator's page, in control with fence 1."""
    page = await open_page("operator")
    assert (await page.take())["fence"] == 1
    return page


@pytest.fixture
def allow(monkeypatch) -> Callable[..., None]:
    """`allow(*entries)`: these `Allowed` entries are the allow-list of every robot."""

    def allow_only(*entries: Allowed) -> None:
        read = selectors.robot_entry

        def with_entries(robot_id):
            found = read(robot_id)
            return found and structs.replace(found, allowed=entries)

        monkeypatch.setattr("teleop.live.consumers.robot_socket.robot_entry", with_entries)
        monkeypatch.setattr("teleop.live.robot_hub.robot_entry", with_entries)

    return allow_only


@pytest.fixture
def other_supervisor(other_robot):
    """A supervisor, but of another robot."""
    person = User.objects.create_user("other", password=PASSWORD, full_name="Otto Other")
    RobotRole.objects.create(robot=other_robot, user=person, role="supervisor")
    return person
