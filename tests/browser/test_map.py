"""The map over the picture: a person sends the robot to a place by a press and a drag, or by its name."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from uuid import uuid4

import pytest
from playwright.sync_api import Locator, expect

from tests.browser.people import PATIENCE_S, Person
from tests.browser.test_pages import found_by_axe

Arrive = Callable[..., Person]
TRIES = 5
# The pixel of a place, as `map_frame.js` has it: whole map, north up.
PIXEL = """async ([x, y]) => {
  const { whole, corners, toPixels } = await import("/static/js/navigation/map_frame.js");
  const { readMaps } = await import("/static/js/navigation/places_api.js");
  const [map] = await readMaps(document.querySelector("main").dataset.robot);
  const canvas = document.querySelector(".map-canvas");
  const size = [canvas.clientWidth, canvas.clientHeight];
  const [left, top] = toPixels(whole(corners(map), ...size), [x, y], ...size);
  const box = canvas.getBoundingClientRect();
  return [box.left + left, box.top + top];
}"""


def opened(operator: Person) -> None:
    """Take control and open the map."""
    operator.take("tiago-2")
    operator.until(lambda: operator.state.get("location"), "a robot that knows where it is")
    open_map(operator)


def open_map(somebody: Person) -> None:
    """Open the map, with its places."""
    somebody.part("map-open").click()
    expect(somebody.page.locator(".map-canvas")).to_be_visible()
    expect(
        somebody.part("places-list").get_by_role("button", name="kitchen", include_hidden=True).first
    ).to_be_attached()


def sent_to(operator: Person, name: str) -> None:
    """Choose a place of the list; again when the robot refuses, since a busy computer's sensor data may be late."""
    choice = operator.part("places-list").get_by_role("button", name=name, exact=True)
    for _ in range(TRIES):
        if not choice.is_visible():
            operator.part("map-places").click()
        choice.click()
        with suppress(AssertionError):
            operator.until(
                lambda: operator.state.get("going"), f"the drive to {name}", timeout_s=PATIENCE_S / TRIES
            )
            return
    raise AssertionError(f"the robot was not sent to {name}")


def chosen(operator: Person, place: tuple[float, float], heading: float) -> None:
    """Press at a place of the map and drag to a heading."""
    x, y = operator.page.evaluate(PIXEL, list(place))
    operator.page.mouse.move(x, y)
    operator.page.mouse.down()
    operator.page.mouse.move(x + 40.0 * math.cos(heading), y - 40.0 * math.sin(heading), steps=4)
    operator.page.mouse.up()


def test_a_press_on_the_map_sends_the_robot_there(person: Arrive) -> None:
    operator = person("operator", apart=True)
    opened(operator)
    here = operator.state["location"]
    place = (here["x"] + 1.2, here["y"])
    operator.part("map-go").click()
    expect(operator.part("map-words")).to_contain_text("Press where the robot should go")
    chosen(operator, place, 0.0)
    expect(operator.part("go-words")).to_contain_text("Drives to a place")
    operator.until(lambda: not operator.state.get("going"), "the end of the drive")
    assert operator.state["going_ended"]["outcome"] == "arrived"
    there = operator.state["location"]
    assert math.dist((there["x"], there["y"]), place) < 0.35

    operator.part("map-go").click()
    chosen(operator, (here["x"], here["y"]), math.pi)
    expect(operator.part("go-words")).to_contain_text("left")
    operator.part("go-cancel").click()
    operator.until(lambda: operator.state["going_ended"]["outcome"] == "cancelled", "the cancel")
    operator.until_still()
    operator.release()


def test_a_robot_is_sent_to_a_named_place_stopped_half_way_and_sent_back(person: Arrive) -> None:
    operator = person("operator", apart=True)
    opened(operator)
    begin = operator.place
    sent_to(operator, "charging dock")
    expect(operator.part("go-words")).to_contain_text("left")
    operator.until_driven(begin, 1.0)
    operator.press("Stop")
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "the stop")
    operator.until_still()
    assert operator.state["going_ended"]["outcome"] == "stopped"
    assert not operator.state.get("going")

    operator.clear()
    sent_to(operator, "kitchen")
    operator.until(lambda: not operator.state.get("going"), "the end of the drive", timeout_s=60.0)
    assert operator.state["going_ended"]["outcome"] == "arrived"
    there = operator.state["location"]
    assert math.dist((there["x"], there["y"]), (1.3, 1.0)) < 0.35
    operator.release()


def test_a_supervisor_adds_a_place_renames_and_deletes_it(person: Arrive) -> None:
    supervisor, name = person("supervisor", apart=True), f"lab {uuid4().hex[:6]}"
    supervisor.watch("tiago-2")
    open_map(supervisor)

    def row(of: str) -> Locator:
        return supervisor.part("places-list").get_by_role("button", name=of, exact=True)

    def named(press: str, by: str) -> None:
        dialog = supervisor.page.get_by_role("dialog")
        dialog.get_by_label("Name").fill(by)
        dialog.get_by_role("button", name=press).click()

    supervisor.part("map-places").click()
    supervisor.press("Add a place on the map")
    chosen(supervisor, (6.0, 1.8), 0.0)
    named("Save", "Kitchen")
    expect(supervisor.part("place-refused")).to_contain_text("a place named “kitchen” already")
    named("Save", name)
    supervisor.part("map-places").click()
    expect(row(name)).to_be_visible()
    row(f"Change {name}").click()
    named("Save", f"{name} 2")
    expect(row(f"{name} 2")).to_be_visible()
    row(f"Change {name} 2").click()
    named("Delete", f"{name} 2")
    question = supervisor.page.get_by_role("dialog", name=f"Delete the place “{name} 2”?")
    question.get_by_role("button", name="Keep it").click()
    expect(row(f"{name} 2")).to_be_visible()
    row(f"Change {name} 2").click()
    named("Delete", f"{name} 2")
    question.get_by_role("button", name="Delete").click()
    expect(row(f"{name} 2")).to_have_count(0)
    supervisor.complaints.clear()  # the refused name is a 409

    supervisor.press("Add a place on the map")
    chosen(supervisor, (5.2, 5.5), 0.0)
    named("Save", "in the wall")
    expect(supervisor.part("place-refused")).to_contain_text("obstacle")
    supervisor.complaints.clear()


def test_an_operator_may_not_change_places(person: Arrive) -> None:
    operator = person("operator")
    operator.watch("tiago-2")
    open_map(operator)
    operator.part("map-places").click()
    expect(operator.part("places-list")).to_be_visible()
    expect(operator.part("places-change")).to_be_hidden()
    expect(operator.part("places-list").get_by_role("button", name="Change")).to_have_count(0)


@pytest.mark.parametrize(("width", "height"), [(360, 640), (844, 390), (1440, 900)])
def test_axe_accepts_the_map_and_no_word_covers_it(person: Arrive, width: int, height: int) -> None:
    operator = person("operator", width=width, height=height, apart=True)
    opened(operator)

    def accepted(what: str) -> None:
        for theme in ("light", "dark"):
            operator.page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
            assert found_by_axe(operator) == [], (what, theme)

    accepted("map")
    operator.part("map-places").click()
    accepted("places")
    operator.part("map-places").click()
    operator.part("map-go").click()
    accepted("a place is chosen")
    words = operator.part("map-words").bounding_box()
    _, south = operator.page.evaluate(PIXEL, [5.0, 0.0])
    assert words is not None
    assert words["y"] >= south - 1.0
    operator.release()
