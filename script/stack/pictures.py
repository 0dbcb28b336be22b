"""script/pictures: the screenshots of README and docs, taken from the running console."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from playwright.sync_api import Browser, Page, sync_playwright

from script.stack.client import sign_in
from script.stack.places import REPOSITORY
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

PICTURES = REPOSITORY / "docs/img"
ROBOT = "tiago-1"
DRIVEN_S = 20.0
SETTLED_S = 1.0  # until notices of what went before are fewer
APPROACH_S = 1.5  # towards the obstacle, once the gate has begun to hold back


def main() -> None:
    """Fleet page, the tabs of the control page on a desk, the centre on a phone."""
    PICTURES.mkdir(exist_ok=True)
    # The first stands before a parcel, not far from the partition and a doorway.
    robots = (replace(PRACTICE_ROBOTS[0], pose=(5.4, 2.6, 8.0)), *PRACTICE_ROBOTS[1:])
    with temporary_stack(robots) as stack, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        cookie = sign_in(stack, "operator")
        with page_of(stack, browser, cookie, 1440, 900, "light") as page:
            drive_to_the_wall(page, stack)
            page.screenshot(path=PICTURES / "control.png")
            page.keyboard.up("w")
            for tab, in_use in TABS.items():
                page.goto(f"{stack.url}/robots/{ROBOT}/#{tab}")
                page.locator(f".control[data-tab={tab}] .hit:visible").first.wait_for()
                in_use(page)
                page.wait_for_timeout(1000.0 * SETTLED_S)
                page.screenshot(path=PICTURES / f"{tab}.png")
            page.goto(f"{stack.url}/")
            page.get_by_text("Online").first.wait_for()
            page.screenshot(path=PICTURES / "fleet.png")
        with page_of(stack, browser, cookie, 844, 390, "dark", scale=2) as page:
            page.goto(f"{stack.url}/robots/{ROBOT}/")
            page.get_by_role("button", name="Take control").click()
            page.get_by_role("button", name="Release").wait_for()
            page.screenshot(path=PICTURES / "phone.png")
        browser.close()


@contextmanager
def page_of(
    stack: Stack, browser: Browser, cookie: str, width: int, height: int, theme: str, *, scale: float = 1
) -> Iterator[Page]:
    """A signed-in page of this size."""
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=theme,  # type: ignore[arg-type]
        device_scale_factor=scale,
        has_touch=width < 1000,
    )
    pairs = (pair.split("=", 1) for pair in cookie.split("; "))
    context.add_cookies([{"name": name, "value": value, "url": stack.url} for name, value in pairs])
    try:
        yield context.new_page()
    finally:
        context.close()


def drive_to_the_wall(page: Page, stack: Stack) -> None:
    """Hold W until the gate says that something is near, and a little longer."""
    page.goto(f"{stack.url}/robots/{ROBOT}/")
    page.get_by_role("button", name="Take control").click()
    page.get_by_role("button", name="Release").wait_for()
    page.keyboard.down("w")
    page.locator("[data-part=words]").filter(has_text="laser").wait_for(timeout=1000 * DRIVEN_S)
    page.wait_for_timeout(1000 * APPROACH_S)


def say_a_phrase(page: Page) -> None:
    """One that is in the history afterwards."""
    page.locator("[data-part=phrase-list] .hit").first.click()
    page.locator("[data-part=history-list] .hit").first.wait_for()


def watch_the_odometry(page: Page) -> None:
    """Its fields, and how one of them goes on."""
    page.get_by_role("searchbox", name="Search topics").fill("controller/odom")
    page.locator("[data-part=topic-list] .hit:visible").click()
    page.locator("[data-part=watches]").get_by_role("button", name="Plot").first.click()
    page.locator("[data-part=topic-plot] canvas").wait_for()


def as_it_is(_page: Page) -> None:
    """Nothing to do."""


TABS = {"motions": as_it_is, "speech": say_a_phrase, "topics": watch_the_odometry}


if __name__ == "__main__":
    main()
