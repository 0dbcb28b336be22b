"""A phone and a robot without a pose: the person sets its pose, sends it to places, stops it, sees it in 3D."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from script.stack.stack import PracticeRobot
from tests.browser.conftest import ARGUMENTS, CHROMIUM
from tests.browser.control.test_limbs import at
from tests.browser.control.test_scene import figures, opened
from tests.browser.map.test_map import PIXEL, open_map
from tests.browser.people import ANSWERS_S, Fingers, Person, running_stack

START, KITCHEN, DOCK = (7.6, 2.0), (1.3, 1.0), (9.2, 2.6)


@pytest.fixture
def operator(tmp_path: Path, browser: Browser) -> Iterator[Person]:
    """A person with a phone that draws 3D, and a separate console with one robot."""
    robot = PracticeRobot("tiago-1", "TIAGo One", (*START, 180.0), camera=False, options=("--lost",))
    flags = [*ARGUMENTS, "--enable-unsafe-swiftshader"]
    with (
        running_stack(tmp_path, [robot]) as stack,
        browser.browser_type.launch(executable_path=CHROMIUM, args=flags) as chromium,
    ):
        somebody = Person(stack, chromium, "operator", width=390, height=844, touch=True)
        somebody.sign_in()
        yield somebody


def test_a_lost_robot_is_told_its_place_sent_and_stopped(operator: Person) -> None:
    fingers = Fingers(operator)
    operator.take("tiago-1")
    open_map(operator)
    expect(operator.part("map-words")).to_contain_text("does not know where it is")
    tell(operator, fingers)
    expect(operator.part("map-words")).to_be_hidden()

    begin = operator.place
    operator.insist(
        "going",
        lambda: by_the_map(operator, fingers),
        lambda: bool(operator.state.get("going")) and math.dist(operator.place, begin) > 1.0,
        "a metre of the way",
    )
    expect(operator.part("going-words")).to_contain_text("Drives to “kitchen”")
    fingers.put(1, operator.middle_of("map"))
    fingers.put(2, operator.middle_of("stop"))
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "confirmed standstill")
    assert operator.state["going_ended"]["outcome"] == "stopped"
    fingers.lift(2)
    fingers.lift(1)

    operator.clear()
    operator.insist(
        "going",
        lambda: by_the_list(operator),
        lambda: bool(operator.state["going_ended"]["outcome"] == "arrived"),
        "the charging dock",
    )
    there = operator.state["location"]
    assert math.dist((there["x"], there["y"]), DOCK) < 0.35

    operator.part("map-open").click()  # closes the map
    operator.part("robot-open").click()
    operator.part("gripper-open").click()
    operator.until(lambda: at(operator, "gripper") > 0.085, "an open gripper")
    expect(operator.part("gripper-at")).to_have_text("9.0 cm")
    operator.part("gripper-close").click()
    operator.until(lambda: at(operator, "gripper") < 0.005, "a closed gripper")
    operator.part("robot-open").click()

    opened(operator)
    operator.until(lambda: figures(operator)["hasMap"], "the map below the robot")
    before = figures(operator)["eye"]
    x, y = operator.middle_of("scene")
    fingers.put(1, (x, y))
    fingers.move(1, (x + 60, y))
    fingers.lift(1)
    operator.until(lambda: figures(operator)["eye"] != before, "another viewpoint")
    operator.release()
    assert operator.complaints == []


def tell(operator: Person, fingers: Fingers) -> None:
    """Tell the robot its place; again if it is refused: a busy computer reads the robot's map late."""

    def knows() -> bool:
        if not operator.state.get("location"):
            expect(operator.part("notices").locator("li")).to_have_count(0)  # a notice may cover the place
            operator.part("map-pose").click()
            x, y = operator.page.evaluate(PIXEL, START)
            fingers.put(1, (x, y))
            fingers.move(1, (x - 40, y))
            fingers.lift(1)
            with suppress(AssertionError):
                operator.until(lambda: operator.state.get("location"), "a place", timeout_s=ANSWERS_S)
        return bool(operator.state.get("location"))

    operator.until(knows, "a robot that knows where it is")


def by_the_map(operator: Person, fingers: Fingers) -> None:
    """Press the kitchen on the map, then the offer to go there. The offer ignores a double tap."""
    offer = operator.part("map-picked-go")
    expect(operator.part("notices").locator("li")).to_have_count(0)  # a notice may cover the place
    fingers.tap(operator.page.evaluate(PIXEL, KITCHEN))
    expect(offer).to_have_text("Go to “kitchen”")

    def taken() -> bool:
        if box := offer.bounding_box():
            fingers.tap((box["x"] + box["width"] / 2, box["y"] + box["height"] / 2))
        return box is None

    operator.until(taken, "an offer that is taken")


def by_the_list(operator: Person) -> None:
    """Choose the charging dock."""
    if not operator.part("places-list").is_visible():
        operator.part("map-places").click()
    operator.part("places-list").get_by_role("button", name="charging dock", exact=True).click()
