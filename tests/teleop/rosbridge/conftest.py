"""Fixtures: clients of the rosbridge door, with tokens."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from datetime import timedelta

import pytest
import pytest_asyncio
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from teleop.background.database import in_database
from tests.teleop.rosbridge.support import Client

OpenClient = Callable[..., Awaitable[Client]]
USUAL = (Scope.DRIVE, Scope.SPEAK, Scope.MOTIONS, Scope.TOPICS)


@pytest.fixture
def make_token(request) -> Callable[..., Awaitable[str]]:
    """`await make_token("operator")`: the text of a token of that person."""

    def make(who: str, scopes=USUAL, robots=()) -> str:
        person = User.objects.filter(username=who).first() or request.getfixturevalue(who)
        expires_at = timezone.now() + timedelta(hours=1)
        _, text = token_make(
            user=person, name="lab script", scopes=scopes, expires_at=expires_at, actor=person, robots=robots
        )
        return text

    async def one(*args, **options) -> str:
        return await in_database(lambda: make(*args, **options))

    return one


@pytest_asyncio.fixture
async def open_client(robot, make_token, bridge) -> AsyncIterator[OpenClient]:
    """`await open_client("operator")`: that person's client of `robot`."""
    opened: list[Client] = []

    async def open_one(who: str | None, slug: str = robot.slug, **options) -> Client:
        token = None if who is None else await make_token(who, **options)
        client = Client(slug, token=token)
        opened.append(client)
        await client.open()
        return client

    yield open_one
    for client in opened:
        await client.close()


@pytest.fixture
async def driver(open_client) -> Client:
    """The operator's client, in control."""
    client = await open_client("operator")
    await client.take()
    return client
