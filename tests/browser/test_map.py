"""The map over the picture: a person sends the robot to a place by a press and a drag, and ends the drive."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from playwright.sync_api import expect

from tests.browser.people import Person

Arrive = Callable[..., Person]
# The pixel of a place, as `map_frame.js` has it: whole map, north up.
PIXEL = """async ([x, y]) => {
  const { whole, corners, toPixels } = await import("/static/js/navigation/map_frame.js");
  const map = await (await fetch(document.querySelector("main").dataset.map)).json();
  const canvas = document.querySelector(".map-canvas");
  const size = [canvas.clientWidth, canvas.clientHeight];
  const [left, top] = toPixels(whole(corners(map), ...size), [x, y], ...size);
  const box = canvas.getBoundingClientRect();
  return [box.left + left, box.top + top];
}"""
KNOWN = "async () => (await fetch(document.querySelector('main').dataset.map + '?look')).status"


def opened(operator: Person) -> None:
    """Take control and open the map, once the console knows it."""
    operator.take("tiago-2")
    operator.until(lambda: operator.state.get("location"), "a robot that knows where it is")
    end_s = time.monotonic() + 20.0
    while operator.page.evaluate(KNOWN) != 200 and time.monotonic() < end_s:
        operator.page.wait_for_timeout(500.0)
    operator.complaints.clear()  # a map that is not there is a 404
    operator.part("map-open").click()
    expect(operator.page.locator(".map-canvas")).to_be_visible()


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
