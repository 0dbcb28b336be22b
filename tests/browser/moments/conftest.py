"""A driving page in a browser, without a console process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from django.test import Client
from playwright.sync_api import Browser

from fleet.accounts.models import User
from robots.registry.models import Robot
from robots.registry.selectors import robot_facts
from tests.browser.moments.driving_page import DrivingPage


@pytest.fixture(autouse=True)
def _beside_a_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DJANGO_ALLOW_ASYNC_UNSAFE", "1")  # Playwright runs an event loop in this thread


@pytest.fixture
def driving(_beside_a_loop: None, browser: Browser, robot: Robot, operator: User) -> Iterator[DrivingPage]:
    client = Client()
    client.force_login(operator)
    context = browser.new_context(reduced_motion="reduce", service_workers="block")
    yield DrivingPage(context.new_page(), client, robot_facts(robot))
    context.close()
