"""The map over the picture: a person sends the robot to a place by a press and a drag, or by the place's name."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from uuid import uuid4

import pytest
from playwright.sync_api import Locator, expect

from tests.browser.people import Person
from tests.browser.test_pages import axe_accepts, axe_accepts_everywhere, box_of

Arrive = Callable[..., Person]
# The pixel of a place, computed by `map_frame.js`: whole map, north up.
PIXEL = """async ([x, y]) => {
  const { whole, corners, toPixels } = await import("/static/js/navigation/map_frame.js");
  const { coveredOf } = await import("/static/js/navigation/map_view.js");
  const { readMaps } = await import("/static/js/navigation/places_api.js");
  const [map] = await readMaps(document.querySelector("main").dataset.robot);
  const canvas = document.querySelector(".map-canvas");
  const size = [canvas.clientWidth, canvas.clientHeight];
  const [left, top] = toPixels(whole(corners(map), ...size, coveredOf(canvas)), [x, y], ...size);
  const box = canvas.getBoundingClientRect();
  return [box.left + left, box.top + top];
}"""


PLACES = """async () => {
  const { readMaps } = await import("/static/js/navigation/places_api.js");
  const [{ places }] = await readMaps(document.querySelector("main").dataset.robot);
  return places.map(({ x, y }) => [x, y]);
}"""
UPPERMOST = "([left, top]) => document.elementFromPoint(left, top)?.outerHTML.slice(0, 80)"


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


def chosen(operator: Person, place: tuple[float, float], heading: float) -> None:
    """Press at a place of the map and drag to a heading."""
    x, y = operator.page.evaluate(PIXEL, list(place))
    operator.page.mouse.move(x, y)
    operator.page.mouse.down()
    operator.page.mouse.move(x + 40.0 * math.cos(heading), y - 40.0 * math.sin(heading), steps=4)
    operator.page.mouse.up()


def go_here(operator: Person) -> None:
    """Take the offer of the ghost. It ignores the second tap of a double tap."""
    offer = operator.part("map-picked-go")
    expect(offer).to_have_text("Go here")

    def taken() -> bool:
        if offer.is_visible():
            offer.click()
        return not offer.is_visible()

    operator.until(taken, "an offer that is taken")


def test_a_press_on_the_map_sends_the_robot_there(person: Arrive) -> None:
    operator = person("operator", apart=True)
    opened(operator)
    here = operator.state["location"]
    place = (here["x"] + 1.2, here["y"])

    def asks_where() -> bool:
        operator.part("map-go").click()  # before the picture of the map has come, it does nothing
        return "Press where the robot should go" in operator.part("map-words").inner_text()

    operator.until(asks_where, "the map to ask for a place")
    chosen(operator, place, 0.0)
    assert operator.state.get("going") is None  # the ghost moves nothing
    go_here(operator)
    expect(operator.part("going-words")).to_contain_text("Drives to a place")
    operator.until(lambda: not operator.state.get("going"), "the end of the drive")
    assert operator.state["going_ended"]["outcome"] == "arrived", operator.state["going_ended"]
    there = operator.state["location"]
    assert math.dist((there["x"], there["y"]), place) < 0.35

    operator.page.mouse.click(*operator.page.evaluate(PIXEL, [here["x"], here["y"]]))
    go_here(operator)
    expect(operator.part("going-words")).to_contain_text("left")
    operator.part("going-cancel").click()
    operator.until(lambda: operator.state["going_ended"]["outcome"] == "cancelled", "the cancel")
    operator.until_still()
    operator.release()


def row(somebody: Person, of: str) -> Locator:
    """Return a button of the list of places."""
    return somebody.part("places-list").get_by_role("button", name=of, exact=True)


def test_a_supervisor_adds_a_place_renames_and_deletes_it(person: Arrive) -> None:
    supervisor, name = person("supervisor", apart=True), f"lab {uuid4().hex[:6]}"
    supervisor.watch("tiago-2")
    open_map(supervisor)

    def named(press: str, by: str) -> None:
        dialog = supervisor.page.get_by_role("dialog")
        dialog.get_by_label("Name").fill(by)
        dialog.get_by_role("button", name=press).click()

    supervisor.part("map-places").click()
    supervisor.press("Add a place on the map")
    chosen(supervisor, (6.0, 1.8), 0.0)
    named("Save", "Kitchen")
    expect(supervisor.part("place-refused")).to_contain_text("a place named “kitchen” already")
    axe_accepts_everywhere(supervisor, "the dialog of a place")
    named("Save", name)
    supervisor.part("map-places").click()
    expect(row(supervisor, name)).to_be_visible()
    row(supervisor, f"Change {name}").click()
    named("Save", f"{name} 2")
    expect(row(supervisor, f"{name} 2")).to_be_visible()
    row(supervisor, f"Change {name} 2").click()
    named("Delete", f"{name} 2")
    axe_accepts_everywhere(supervisor, "the question before a place is deleted")
    question = supervisor.page.get_by_role("dialog", name=f"Delete the place “{name} 2”?")
    question.get_by_role("button", name="Keep it").click()
    expect(row(supervisor, f"{name} 2")).to_be_visible()
    row(supervisor, f"Change {name} 2").click()
    named("Delete", f"{name} 2")
    question.get_by_role("button", name="Delete").click()
    expect(row(supervisor, f"{name} 2")).to_have_count(0)
    supervisor.complaints.clear()  # the refused name is a 409

    supervisor.press("Add a place on the map")
    chosen(supervisor, (5.2, 5.5), 0.0)
    named("Save", "in the wall")
    expect(supervisor.part("place-refused")).to_contain_text("obstacle")
    supervisor.complaints.clear()


def test_places_go_through_a_file(person: Arrive) -> None:
    supervisor, name = person("supervisor", apart=True), f"lab {uuid4().hex[:6]}"
    supervisor.watch("tiago-2")
    open_map(supervisor)
    supervisor.part("map-places").click()
    with supervisor.page.expect_download() as download:
        supervisor.part("places-export").click()
    exported = Path(download.value.path()).read_text()
    assert "\nkitchen,1.3,1.0," in exported

    def imported(content: bytes) -> None:
        with supervisor.page.expect_file_chooser() as chooser:
            supervisor.press("Import")
        chooser.value.set_files({"name": "places.csv", "mimeType": "text/csv", "buffer": content})

    imported(f'{exported}"{name}","6.0","1.8","0"\r\n'.encode())
    expect(supervisor.part("notices")).to_contain_text("1 added, 0 moved")
    expect(row(supervisor, name)).to_be_visible()
    imported("name,x,y,heading\nKüche,6,1.8,0\n".encode("windows-1252"))
    expect(supervisor.part("notices")).to_contain_text("This file is not UTF-8 text")
    row(supervisor, f"Change {name}").click()
    supervisor.page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    supervisor.page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    expect(row(supervisor, name)).to_have_count(0)


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
        axe_accepts(operator, what)

    accepted("map")
    here = operator.state["location"]
    for place in [*operator.page.evaluate(PLACES), [here["x"], here["y"]]]:
        pixel = operator.page.evaluate(PIXEL, place)
        assert operator.page.evaluate(UPPERMOST, pixel).startswith('<canvas class="map-canvas"'), place
    operator.part("map-places").click()
    accepted("places")
    operator.part("map-places").click()
    operator.page.mouse.click(*operator.page.evaluate(PIXEL, [1.3, 1.0]))
    expect(operator.part("map-picked-go")).to_have_text("Go to “kitchen”")
    accepted("a place is picked")
    closes = operator.part("map-picked-close")
    if closes.is_visible():  # axe-core holds the page up: then the world is old, and the offer has gone
        closes.click()
    operator.part("map-go").click()
    words = box_of(operator.part("map-words"))
    _, south = operator.page.evaluate(PIXEL, [5.0, 0.0])
    if height > 400:  # on a phone held sideways all words lie on the map
        assert words["y"] >= south - 1.0
    accepted("a place is chosen")
    operator.release()
