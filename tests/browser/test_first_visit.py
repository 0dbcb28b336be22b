"""A newcomer: hints, help, the person's own arrangement, the lab's monitor, the console as an installed app."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.browser.people import Person
from tests.browser.test_pages import SIZES, box_of, found_by_axe, overlap, too_small

Arrive = Callable[..., Person]
KEPT = """async () => {
  const opened = await Promise.all((await caches.keys()).map((name) => caches.open(name)));
  const requests = await Promise.all(opened.map((cache) => cache.keys()));
  return requests.flat().map(({ url }) => new URL(url).pathname);
}"""


def keep_choices(person: Person, fields: str) -> None:
    """Store these choices about the control page in the person's account."""
    person.open("/accounts/")
    status = person.page.evaluate(
        """async (body) => {
          const token = document.querySelector("[name=csrfmiddlewaretoken]").value;
          const headers = {
            "X-CSRFToken": token, "Content-Type": "application/x-www-form-urlencoded", Accept: "application/json",
          };
          return (await fetch("/accounts/settings/page/", { method: "POST", headers, body })).status;
        }""",
        fields,
    )
    assert status == 204


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_newcomer_is_led_by_three_hints(person: Arrive, width: int, height: int) -> None:
    staff = person("staff")
    staff.watch("tiago-2")
    if staff.state["stop"]["state"] != "clear":  # by another test; it would be the reason in the hint's place
        staff.clear()
    operator = person("operator", width=width, height=height, newcomer=True, apart=True)
    keep_choices(operator, "hints_seen=false")
    operator.watch("tiago-2")
    hint = operator.part("first-steps")
    expect(hint).to_contain_text("1 of 3")
    assert found_by_axe(operator) == []
    assert [one for one in too_small(operator) if "hint" in one] == []
    expect(hint).to_be_visible()  # if the page of a busy computer shows a reason, the hint comes after it
    for opener in operator.page.locator(".picture-tools button:visible").all():
        assert not overlap(box_of(hint), box_of(opener))
    operator.press("Take control")
    operator.until_in_control()
    expect(hint).to_contain_text("2 of 3")
    operator.push("a", until=lambda: operator.state["odometry"]["w"] > 0.05, what="a turn")
    operator.let_go("a")
    expect(hint).to_contain_text("3 of 3")
    expect(hint).to_be_visible()  # if the page of a busy computer shows a reason, the hint comes after it
    assert not overlap(box_of(hint), box_of(operator.page.locator("form.stop .stop-button")))
    with operator.page.expect_response("**/accounts/settings/page/"):  # the account stores this choice
        operator.page.get_by_role("button", name="Got it").click()
    expect(hint).to_be_hidden()
    operator.page.evaluate("localStorage.clear()")  # like another browser: the choice comes from the account
    operator.watch("tiago-2")
    expect(hint).to_be_hidden()
    operator.page.locator(".menu summary").click()
    operator.press("First steps")
    expect(hint).to_contain_text("1 of 3")
    operator.until_in_control()
    operator.release()


def test_help_in_the_menu_leads_to_the_operators_page(person: Arrive) -> None:
    observer = person("observer", width=360, height=640)
    observer.watch("tiago-2")
    observer.page.locator(".menu summary").click()
    observer.page.get_by_role("link", name="Help").click()
    page = observer.page
    page.get_by_role("heading", name="For operators").wait_for()
    page.get_by_role("link", name="the student's page").click()
    page.get_by_role("heading", name="Drive a robot").wait_for()
    page.wait_for_function(
        "() => [...document.querySelectorAll('article img')].every((one) => one.naturalWidth > 0)"
    )
    assert page.evaluate("document.scrollingElement.scrollWidth") == 360
    assert found_by_axe(observer) == []
    assert observer.complaints == []


def test_panels_move_by_drag_and_keys_and_stay(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    page = operator.page
    panel = {name: page.locator(f"[data-panel={name}]") for name in ("chart", "motions", "phrases")}
    before = {name: box_of(one) for name, one in panel.items()}
    page.get_by_role("button", name="Move the motions").press("ArrowLeft")
    assert operator.drives == [] or {(drive["x"], drive["w"]) for drive in operator.drives} == {(0, 0)}
    assert abs(box_of(panel["motions"])["x"] - before["chart"]["x"]) < 2
    x, y = (before["motions"][key] + 20 for key in ("x", "y"))
    page.get_by_role("button", name="Move the phrases").hover()
    page.mouse.down()
    page.mouse.move(x, y, steps=4)
    page.mouse.up()
    moved = {name: box_of(one) for name, one in panel.items()}
    assert moved["phrases"] == before["motions"]
    assert found_by_axe(operator) == []
    page.evaluate("localStorage.clear()")  # like another browser: the choice comes from the account
    operator.watch("tiago-2")
    operator.until_in_control()
    assert {name: box_of(one)["x"] for name, one in panel.items()} == {
        name: box["x"] for name, box in moved.items()
    }
    operator.release()
    keep_choices(operator, 'robot=tiago-2&layout={"cells":[]}')  # the places that other tests expect


def test_the_labs_monitor_has_nothing_to_press(person: Arrive) -> None:
    observer, operator = person("observer", width=1920, height=1080), person("operator")
    observer.open("/?wall")
    page = observer.page
    card = page.locator("[data-robot=tiago-2]")
    expect(card).to_contain_text("Stands, nobody has control")
    assert page.locator("a:not(.skip), button, input, form, summary").count() == 0
    assert found_by_axe(observer) == []
    operator.take("tiago-2")
    turning = card.get_by_text("Turns on the spot")
    operator.push("a", until=turning.is_visible, what="a turn on the monitor")
    operator.let_go("a")
    expect(card).to_contain_text("Stands, Operator has control")
    operator.release()
    operator.open("/?wall")
    expect(operator.page.get_by_text("This account may drive robots.")).to_be_visible()


def test_offline_the_app_says_so_and_comes_back(person: Arrive) -> None:
    operator = person("operator", width=360, height=640, newcomer=True, apart=True)
    page = operator.page
    operator.open("/")
    page.evaluate("navigator.serviceWorker.ready")
    operator.context.set_offline(True)
    operator.open("/robots/tiago-2/")
    expect(page).to_have_title(re.compile("Offline"))
    assert found_by_axe(operator) == []
    assert [path for path in page.evaluate(KEPT) if not path.startswith("/static/")] == ["/offline/"]
    operator.context.set_offline(False)
    expect(page).to_have_title(re.compile("TIAGo Two"))
