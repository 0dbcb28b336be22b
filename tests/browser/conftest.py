"""The whole console with simulated robots, and people in front of real browsers.

One stack (rosmasters, simulators, supervisor, bridges, web process) serves all browser tests of a test process;
robots go on from where the test before left them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from typing import Any, NoReturn

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


@pytest.fixture(scope="package")
def desks() -> dict[tuple[str, bool], list[Person]]:
    """Browsers that tests have left, by role and touch: in one of them a page opens in a third of the time."""
    return defaultdict(list)


@pytest.fixture
def person(
    stack: Stack,
    browser: Browser,
    cookies: Callable[[str], Any],
    desks: dict[tuple[str, bool], list[Person]],
    request: pytest.FixtureRequest,
) -> Iterator[Callable[..., Person]]:
    """`person("operator", width=360, height=640, touch=True)`: signed in, in a browser of their own, on no page yet.

    It may be one that a test before has left, its storage empty. `apart=True`: a new one that ends with the test, which
    does to it what cannot be undone.
    """
    failed_before = request.session.testsfailed
    with ExitStack() as leaving:

        def get_up(somebody: Person, free: list[Person]) -> None:
            if request.session.testsfailed > failed_before:  # who knows which key is still down
                somebody.leave()
            else:
                somebody.get_up()
                free.append(somebody)

        def arrive(role: str, *, touch: bool = False, apart: bool = False, **looks: Any) -> Person:
            free = desks[role, touch]
            if free and not apart:
                somebody = free.pop()
                somebody.sit_down(**looks)
            else:
                somebody = Person(stack, browser, role, touch=touch, **looks)
                somebody.context.add_cookies(cookies(role))
            if apart:
                leaving.callback(somebody.leave)
            else:
                for lasting in ("add_init_script", "on", "route", "route_web_socket"):
                    setattr(somebody.page, lasting, _only_apart)
                leaving.callback(get_up, somebody, free)
            return somebody

        yield arrive


def _only_apart(*_args: object, **_options: object) -> NoReturn:
    raise AssertionError("it would be there in later tests too: person(..., apart=True)")
