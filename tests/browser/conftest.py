"""The whole console with simulated robots, and people in front of real browsers.

One stack (rosmasters, simulators, supervisor, bridges, web process) serves all browser tests of a test process;
robots go on from where the test before left them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from typing import Any

import pytest
from playwright.sync_api import Browser, sync_playwright

from script.stack.stack import PracticeRobot, Stack
from tests.browser.people import Person

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--disable-quic",
]
# The first looks at the east wall of the hall from two metres off; the second stands free in the hall.
ROBOTS = (
    PracticeRobot("tiago-1", "TIAGo One", (7.6, 2.0, 0.0)),
    PracticeRobot("tiago-2", "TIAGo Two", (2.0, 1.8, 0.0)),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The usability tasks come first: they have robots of their own, and need not run beside everybody else's."""
    items.sort(key=lambda item: item.path.name != "test_usability.py")


@pytest.fixture(scope="package")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """The console, ready, on a free port."""
    stack = Stack(tmp_path_factory.mktemp("stack"), robots=ROBOTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("DJANGO_SETTINGS_MODULE", raising=False)  # the stack runs the product's settings
        stack.launch()
    try:
        stack.wait_ready()
        yield stack
    finally:
        stack.end()


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Debian's Chromium."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def cookies(stack: Stack, browser: Browser) -> Callable[[str], Any]:
    """`cookies("operator")`: what the sign-in page gave that person. Each signs in once, by that page."""

    @cache
    def signed_in(role: str) -> Any:
        somebody = Person(stack, browser, role)
        try:
            somebody.sign_in()
            return somebody.context.cookies()
        finally:
            somebody.leave()

    return signed_in


@pytest.fixture
def person(stack: Stack, browser: Browser, cookies: Callable[[str], Any]) -> Iterator[Callable[..., Person]]:
    """`person("operator", width=360, height=640, touch=True)`: signed in, in a browser of their own, on no page yet."""
    with ExitStack() as leaving:

        def arrive(role: str, **looks: object) -> Person:
            somebody = Person(stack, browser, role, **looks)  # type: ignore[arg-type]
            leaving.callback(somebody.leave)
            somebody.context.add_cookies(cookies(role))
            return somebody

        yield arrive
