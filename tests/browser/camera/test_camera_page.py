"""The control page of a robot with two cameras: every size and theme, old pictures, notices and requests."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from script.stack.stack import Stack
from tests.browser.camera.test_camera import shows_a_picture
from tests.browser.conftest import PutBack
from tests.browser.people import Person, faults_of
from tests.browser.test_pages import SIZES, axe_accepts, box_of, overlap, too_small, what_stays_free

Arrive = Callable[..., Person]
pytestmark = pytest.mark.usefixtures("tiago_one")
# Texts of the view bar's buttons that something covers.
COVERED = """() => [...document.querySelectorAll("[data-part=view-bar] button")]
  .filter((one) => one.checkVisibility())
  .filter((one) => {
    const { x, y, width, height } = one.getBoundingClientRect();
    return !one.contains(document.elementFromPoint(x + width / 2, y + height / 2));
  })
  .map((one) => one.ariaLabel || one.textContent)"""
ROBOT = "tiago-1"
IN_THE_HALL = (2.0, 1.8, 0.0)  # m, degrees; 7 m of free space ahead


@pytest.fixture
def faults(stack: Stack, tmp_path: Path) -> Iterator[Callable[[str], None]]:
    """``faults(names)`` sets the simulated robot's faults until the end of the test."""
    with faults_of(stack.robots[ROBOT], tmp_path) as begin:
        yield begin


def open_view_bar(person: Person) -> None:
    """Open the view bar. Only a small screen has a button for this."""
    opener = person.part("view-open")
    if opener.is_visible() and opener.get_attribute("aria-expanded") == "false":
        opener.click()


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_page_with_two_cameras_fits_every_window(person: Arrive, width: int, height: int) -> None:
    operator = person("operator", width=width, height=height)
    operator.take(ROBOT)
    shows_a_picture(operator)
    open_view_bar(operator)
    operator.press("Second camera")
    second = operator.part("second")
    expect(second.locator(".camera-words")).to_be_hidden()
    open_view_bar(operator)
    axe_accepts(operator, "cameras")
    open_view_bar(operator)
    assert too_small(operator) == []
    assert operator.page.evaluate(COVERED) == []
    operator.page.keyboard.press("Escape")
    tools = [box_of(one) for one in operator.page.locator(".picture-tools button:visible").all()]
    assert tools and not any(overlap(box_of(second), one) for one in tools)
    stick, stop = box_of(operator.part("zone")), box_of(operator.page.locator("form.stop .stop-button"))
    assert not any(overlap(what_stays_free(operator, "camera"), one) for one in (stick, stop))

    operator.part("second-swap").click()
    expect(operator.part("camera").locator(".camera-picture")).to_have_attribute(
        "aria-label", re.compile("Behind|Rear", re.IGNORECASE)
    )
    shows_a_picture(operator)
    operator.part("second-swap").click()
    expect(operator.part("camera").locator(".camera-picture")).to_have_attribute("aria-label", "Head camera")
    operator.release()
    assert operator.complaints == []


def test_a_picture_that_stands_still_is_grey_and_slows_the_robot(
    person: Arrive, tiago_one: PutBack, faults: Callable[[str], None]
) -> None:
    tiago_one(IN_THE_HALL)
    operator = person("operator")
    operator.take(ROBOT)
    shows_a_picture(operator)
    operator.part("views").get_by_role("button", name="Camera").click()
    faults("camera_frozen")
    expect(operator.part("camera")).to_have_attribute("data-old", "true")
    expect(operator.part("camera").locator(".camera-age")).to_have_text(re.compile(r"picture [\d.]+ s old"))

    def held_to() -> float | None:
        """Return the bridge's speed limit for the late picture, m/s; None without a limit."""
        limits = operator.state["verdict"]["limits"]
        found = [limit for limit in limits if limit["code"] == "camera_late"]
        return float(re.search(r"at most ([\d.]+) m/s", found[0]["text"])[1]) if found else None  # type: ignore[index]

    operator.push(
        "w", until=lambda: (held_to() or 1.0) < 0.3, what="a limit that falls as the picture grows old"
    )
    expect(operator.part("all-limits")).to_contain_text("the camera’s picture comes after")
    assert abs(operator.state["odometry"]["vx"]) < 0.35
    faults("none")
    operator.until(lambda: held_to() is None, "the end of the limit")
    operator.let_go("w")
    expect(operator.part("camera")).not_to_have_attribute("data-old", "true")
    operator.release()


def test_notices_and_requests_leave_camera_and_chart_free(person: Arrive) -> None:
    operator, staff = person("operator"), person("staff")
    operator.take(ROBOT)
    shows_a_picture(operator)
    chart, camera = box_of(operator.part("chart")), box_of(operator.part("picture-area"))
    staff.watch(ROBOT)
    staff.press("Ask for control")
    operator.page.get_by_role("button", name="Hand over to Staff").wait_for()
    assert box_of(operator.part("chart")) == chart
    assert not overlap(box_of(operator.part("requests")), camera)
    staff.press("Leave the line")
    play = staff.part("motion-list").get_by_role("button").first
    play.wait_for()
    play.evaluate("button => button.click()")  # refused, because staff has no control
    notice = staff.page.locator(".notices .notice").first
    notice.wait_for()
    shown = box_of(notice)
    for protected in ("picture-area", "zone", "stop"):
        assert not overlap(shown, box_of(staff.part(protected))), protected
    operator.release()


# The thumbnail has a picture: two of its pixels differ.
PAINTED = """() => {
  const { width, height } = document.querySelector("[data-thumbnail=tiago-1]");
  const pen = document.querySelector("[data-thumbnail=tiago-1]").getContext("2d");
  const colour = (x, y) => String(pen.getImageData(x, y, 1, 1).data);
  return width > 100 && colour(0, 0) !== colour(width >> 1, height >> 1);
}"""


@pytest.mark.parametrize("page", ["/", "/?wall"])
def test_card_and_wall_show_the_newest_picture(person: Arrive, page: str) -> None:
    observer = person("observer")
    observer.open(page)
    expect(observer.page.locator(f"[data-thumbnail={ROBOT}]")).to_be_visible()
    observer.page.wait_for_function(PAINTED)
    axe_accepts(observer, "cameras")
    assert observer.complaints == []
