"""Staff find out who made a robot say a sentence, and where the robot drove."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from script.stack.stack import Stack
from tests.browser.control.test_console import go_to, notice
from tests.browser.people import Person
from tests.browser.test_pages import A_LONG_NAME, SIZES, found_by_axe

Arrive = Callable[..., Person]

SENTENCE = "The cat sat on the warm charger."
ROOMS = (10.0, 7.0)  # m, size of the map
DRIFT_M = 0.5

MARKER_ON_THE_MAP = """marker => {
  const map = document.querySelector(".path-plot image");
  const { e, f } = marker.getScreenCTM();
  const { x, y } = new DOMPoint(e, f).matrixTransform(map.getScreenCTM().inverse());
  return [x, y];
}"""
SIZE_OF_THE_MAP = """async image => {
  const { width, height } = await createImageBitmap(await (await fetch(image.href.baseVal)).blob());
  return [width, height];
}"""


@pytest.fixture(scope="module")
def spoken(stack: Stack, browser: Browser) -> Iterator[Person]:
    """An operator takes control, says the sentence, drives a little, and releases control."""
    operator = Person(stack, browser, "operator")
    operator.sign_in()
    operator.take("tiago-2")
    go_to(operator, "Speech")
    operator.part("say-text").fill(SENTENCE)
    operator.part("say-text").press("Enter")
    notice(operator, f"Said: “\u2068{SENTENCE}\u2069”")
    go_to(operator, "Drive")
    operator.page.locator("main").focus()
    operator.drive("a", "w", metres=0.3)
    operator.let_go("a", "w")
    operator.until_still()
    operator.page.wait_for_timeout(1000)  # a drive ends when the robot stands still
    operator.release()
    yield operator
    operator.leave()


@pytest.fixture(scope="module")
def came_to(spoken: Person) -> dict[str, float]:
    """Where the robot then believed to be, on the map."""
    location: dict[str, float] = spoken.state["location"]
    return location


def test_staff_find_a_text_in_three_steps_and_its_path(
    person: Arrive, spoken: Person, came_to: dict[str, float], tmp_path: Path
) -> None:
    staff = person("staff")
    page = staff.page
    # Step 1: the history of speech. Step 2: filter by day, person and a word. Step 3: open the record.
    staff.open("/admin/audit/speechrecord/")
    today = datetime.now(UTC).date().isoformat()
    page.get_by_label("From").fill(today)
    page.get_by_label("To", exact=True).fill(today)
    page.get_by_label("Person").fill(spoken.account.username)
    page.get_by_label("Said").fill("warm charger")
    page.get_by_role("button", name="Show", exact=True).click()
    page.wait_for_url(re.compile("warm"))
    found = page.locator(".audit-table tr", has_text=SENTENCE)
    expect(found).to_have_count(1)
    outcomes_stay_whole_words(staff)

    with page.expect_download() as download:
        page.get_by_role("button", name="JSON Lines").click()
    file = tmp_path / "speech.jsonl"
    download.value.save_as(file)
    [exported] = [json.loads(line) for line in file.read_text().splitlines()]
    assert exported["details"]["text"] == SENTENCE

    found.get_by_role("link", name="Control session").click()
    page.get_by_role("heading", name="Operator on TIAGo Two").wait_for()
    said = staff.part("timeline").locator("li", has_text=SENTENCE)
    assert said.is_visible()
    assert found_by_axe(staff) == []
    scrub_the_path(staff)
    the_robot_is_where_it_was_on_the_map(staff, came_to)
    page.emulate_media(color_scheme="dark")
    assert found_by_axe(staff) == []
    assert staff.complaints == []


def outcomes_stay_whole_words(staff: Person) -> None:
    """Check that no outcome is broken into two lines, also next to long names."""
    torn = """name => {
      for (const who of document.querySelectorAll(".audit-who")) who.textContent = name;
      const words = [...document.querySelectorAll(".audit-table thead th:nth-child(5), .audit-outcome")];
      const text = document.createRange();
      return words.map((cell) => cell.textContent.trim()).filter((word, i) => {
        text.selectNodeContents(words[i]);
        return word && !word.includes(" ") && text.getClientRects().length > 1;
      });
    }"""
    assert staff.page.evaluate(torn, A_LONG_NAME) == []


def scrub_the_path(staff: Person) -> None:
    """Check that keys, buttons and presses on the timeline move the robot in the picture."""
    moment, marker, entries = staff.part("moment"), staff.part("marker"), staff.part("timeline").locator("li")
    drives = entries.filter(has_text="Drive began")

    def place() -> str | None:
        return marker.get_attribute("transform")

    staff.page.wait_for_load_state()  # the page's script has loaded
    drives.last.locator("time").click()
    assert drives.last.get_attribute("aria-current") == "true"
    begun = place()
    moment.focus()
    staff.page.keyboard.press("ArrowRight")
    assert place() != begun
    assert "driving" in (moment.get_attribute("aria-valuetext") or "")
    staff.page.keyboard.press("End")
    assert entries.last.get_attribute("aria-current") == "true"
    assert "standing" in staff.part("moment-words").inner_text()
    staff.page.get_by_role("button", name="To the entry before").click()
    assert entries.last.get_attribute("aria-current") is None


def the_robot_is_where_it_was_on_the_map(staff: Person, location: dict[str, float]) -> None:
    """Check that the map shows the robot where it believed to be (`location`) when the session ended."""
    image, marker = staff.page.locator(".path-plot image"), staff.part("marker")
    assert image.evaluate(SIZE_OF_THE_MAP) == [20 * metres for metres in ROOMS]  # cells of 5 cm
    staff.part("moment").press("End")
    right, down = marker.evaluate(MARKER_ON_THE_MAP)
    assert math.dist((right, ROOMS[1] - down), (location["x"], location["y"])) < DRIFT_M


def test_a_person_finds_their_session_and_exports_their_data(
    spoken: Person,
) -> None:
    spoken.open("/")
    spoken.page.locator(".menu summary").click()
    spoken.page.get_by_role("link", name="Your data").click()
    with spoken.page.expect_download() as download:
        spoken.press("Export as JSON Lines")
    assert SENTENCE in download.value.path().read_text()
    spoken.page.get_by_role("link", name="TIAGo Two").first.click()
    for width, height in SIZES:
        spoken.page.set_viewport_size({"width": width, "height": height})
        spoken.part("moment").wait_for()
        assert spoken.page.evaluate("document.scrollingElement.scrollWidth") == width
    assert spoken.page.get_by_text(SENTENCE).first.is_visible()
    assert spoken.complaints == []
    without_scripts(spoken)


def without_scripts(spoken: Person) -> None:
    """Check that the page shows a plain timeline next to the path when the browser runs no scripts."""
    browser = spoken.context.browser
    assert browser is not None
    plain = browser.new_context(java_script_enabled=False, storage_state=spoken.context.storage_state())
    try:
        page = plain.new_page()
        page.goto(spoken.page.url)
        assert page.locator(".timeline li", has_text=SENTENCE).is_visible()
        assert page.locator(".path-plot polyline").count() > 0
        assert not page.get_by_label("Moment").is_visible()
    finally:
        plain.close()
