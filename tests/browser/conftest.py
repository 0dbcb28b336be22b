"""The whole console with simulated robots, and people in front of real browsers.

All browser tests of a test process use one stack (rosmasters, simulators, supervisor, bridges, web process).
Each test finds the robots at their start. TIAGo One is off, because a second robot takes a fifth of a processor: a test
that needs it asks for `tiago_one`.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from typing import Any, NoReturn
from uuid import uuid4

import pytest
from playwright.sync_api import Browser, expect, sync_playwright
from xdist.scheduler import LoadFileScheduling

from script.stack.stack import PracticeRobot, Stack
from tests.browser.people import Person, PutBack, putting_back, running_stack

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--disable-quic",
    # Chromium reads only the last --disable-features. So this one has Playwright's list, and also the popups of the
    # address bar: nobody sees them, and they would cost each new window a second of computing time.
    "--disable-features=AvoidUnnecessaryBeforeUnloadCheckSync,DestroyProfileOnBrowserClose,HttpsUpgrades,"
    "HttpsFirstBalancedModeAutoEnable,LensOverlay,MediaRouter,PaintHolding,ThirdPartyStoragePartitioning,"
    "OptimizationHints,WebUIOmniboxPopup,WebUIOmniboxAimPopup",
]
ROBOTS = (
    PracticeRobot("tiago-1", "TIAGo One", (7.6, 2.0, 0.0), rear_camera=True, is_on=False),
    PracticeRobot("tiago-2", "TIAGo Two", (2.0, 1.8, 0.0), camera=False),  # in free space in the hall
)
AT_THE_WALL = (8.3, 2.0, 0.0)  # the hall's east wall is 1.3 m ahead
ONLINE_S = 60.0  # time limit on a busy computer; usually it takes 5 s
WITHOUT_CONSOLE = "tests/browser/moments/"  # pages that Django answers in the test's process


class ByConsole(LoadFileScheduling):
    """Runs all tests that share the console in one process, and those without one beside them."""

    def _split_scope(self, nodeid: str) -> str:
        return WITHOUT_CONSOLE if nodeid.startswith(WITHOUT_CONSOLE) else "console"


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByConsole:
    """Distribute the tests; this replaces `--dist`."""
    return ByConsole(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the usability tasks first: they start separate robots, which then do not run together with all others."""
    items.sort(key=lambda item: item.path.name != "test_usability.py")


@pytest.fixture(scope="package")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """The running console on a free port."""
    with running_stack(tmp_path_factory.mktemp("stack"), ROBOTS) as stack:
        yield stack


@pytest.fixture(scope="package")
def tiago_two(stack: Stack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PutBack]:
    """`tiago_two(AT_THE_WALL)`: put TIAGo Two there."""
    with putting_back(stack.robots["tiago-2"], tmp_path_factory.mktemp("start")) as put_back:
        yield put_back


@pytest.fixture(scope="module")
def tiago_one(stack: Stack, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PutBack]:
    """TIAGo One, which has a camera at its head and one at its back, is on until the end of the test file."""
    robot = stack.robots["tiago-1"]
    robot.switch_on()
    try:
        stack.wait_online("tiago-1", time.monotonic() + ONLINE_S)
        with putting_back(robot, tmp_path_factory.mktemp("start")) as put_back:
            yield put_back
    finally:
        robot.switch_off()


@pytest.fixture(autouse=True)
def _robots_at_start(request: pytest.FixtureRequest) -> None:
    for name, uses in (("tiago_two", "stack"), ("tiago_one", "tiago_one")):
        if uses in request.fixturenames:
            request.getfixturevalue(name)()


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Debian's Chromium."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def cookies(stack: Stack, browser: Browser) -> Callable[[str], Any]:
    """`cookies("operator")`: the cookies of this person's sign-in. Each person signs in once, by the page."""

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
def free_browsers() -> dict[tuple[str, bool], list[Person]]:
    """Browsers of finished tests, by role and touch. Reuse makes pages open in a third of the time."""
    return defaultdict(list)


@pytest.fixture
def person(
    stack: Stack,
    browser: Browser,
    cookies: Callable[[str], Any],
    free_browsers: dict[tuple[str, bool], list[Person]],
    request: pytest.FixtureRequest,
) -> Iterator[Callable[..., Person]]:
    """`person("operator", width=360, height=640, touch=True)`: a signed-in person in a browser without a page.

    The browser may be reused; its storage is empty. `apart=True`: a new browser, closed after the test, for changes
    that cannot be undone.
    """
    failed_before = request.session.testsfailed
    with ExitStack() as leaving:

        def give_back(somebody: Person, free: list[Person]) -> None:
            if request.session.testsfailed > failed_before:  # a key may still be down
                somebody.leave()
            else:
                somebody.clear_browser()
                free.append(somebody)

        def arrive(role: str, *, touch: bool = False, apart: bool = False, **looks: Any) -> Person:
            free = free_browsers[role, touch]
            if free and not apart:
                somebody = free.pop()
                somebody.prepare(**looks)
            else:
                somebody = Person(stack, browser, role, touch=touch, **looks)
                somebody.context.add_cookies(cookies(role))
            if apart:
                leaving.callback(somebody.leave)
            else:
                for lasting in ("add_init_script", "on", "route", "route_web_socket"):
                    setattr(somebody.page, lasting, _only_apart)
                leaving.callback(give_back, somebody, free)
            return somebody

        yield arrive


@pytest.fixture
def induction(person: Callable[..., Person]) -> Iterator[str]:
    """The name of a qualification that TIAGo Two requires until the end of the test."""
    staff, name = person("staff"), f"Induction {uuid4().hex[:6]}"
    staff.open("/qualifications/")
    new = staff.page.get_by_role("region", name="New qualification")
    new.get_by_label("Name").fill(name)
    new.get_by_label("Description").fill("Every Monday.")
    new.get_by_label("TIAGo Two").check()
    new.get_by_role("button", name="Save").click()
    asks = staff.page.get_by_role("button", name="Do it")  # other tests may have left bookings
    expect(asks.or_(staff.page.get_by_text(f"{name} is saved."))).to_be_visible()
    if asks.is_visible():
        asks.click()
    yield name
    staff.open("/qualifications/")
    staff.page.locator("details", has_text=name).locator("summary").click()
    staff.page.locator("details", has_text=name).get_by_role("button", name="Delete").click()


def _only_apart(*_args: object, **_options: object) -> NoReturn:
    raise AssertionError("it would be there in later tests too: person(..., apart=True)")
