"""A robot with ROS 2 at a person's hands: it brakes before a table leg, speaks, waves, and is stopped on its way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from script.stack.stack import PracticeRobot
from tests.browser.map.test_map import open_map
from tests.browser.people import Fingers, Person, running_stack
from tests.ros2.side import needs_rclpy

pytestmark = needs_rclpy
BEFORE_A_LEG = (5.55, 2.3, -90.0)  # of the hall table, with room for the arm
ROBOT = PracticeRobot("tiago-3", "TIAGo Three", BEFORE_A_LEG, camera=False, ros=2)
SENTENCE = "Good morning, this is a robot."


@pytest.fixture
def operator(tmp_path: Path, browser: Browser) -> Iterator[Person]:
    """A person with a phone, and a console with this robot."""
    with running_stack(tmp_path, [ROBOT]) as stack:
        somebody = Person(stack, browser, "operator", width=390, height=844, touch=True)
        somebody.sign_in()
        yield somebody
        somebody.leave()


def test_it_is_driven_heard_sent_and_stopped_like_the_others(operator: Person) -> None:
    operator.take(ROBOT.slug)
    expect(operator.page.get_by_text("ROS 2")).to_have_count(1)
    expect(operator.page.get_by_text("ROS 2")).to_be_visible()
    fingers = Fingers(operator)
    waves_and_speaks(operator)
    brakes_before_the_leg(operator, fingers)
    is_stopped_on_its_way(operator, fingers)
    operator.clear()
    operator.release()
    the_log_has_it(operator)
    assert operator.complaints == []


def waves_and_speaks(operator: Person) -> None:
    """Let the robot say a sentence, wave, and fold its arm."""

    def say() -> None:
        operator.page.get_by_role("tab", name="Speech").click()
        operator.part("say-text").fill(SENTENCE)
        operator.press("Say")

    def wave() -> None:
        operator.page.get_by_role("tab", name="Motions").click()
        operator.press("Play Wave")

    def marked() -> bool:
        return operator.part("speech-word").inner_text() in SENTENCE.split()

    operator.insist("speech", say, marked, "a word that is spoken")
    operator.insist("motion", wave, lambda: bool(operator.state["arm"]), "an arm that leaves its home")
    operator.until(lambda: operator.state["motion"] is None, "its end")
    operator.insist("speech", say, lambda: ended(operator, "speech", "done"), "the end of the sentence")
    operator.fold_arm()


def ended(operator: Person, task: str, outcome: str) -> bool:
    """Whether the last task of this kind ended so."""
    return bool((operator.state[f"{task}_ended"] or {}).get("outcome") == outcome)


def brakes_before_the_leg(operator: Person, fingers: Fingers) -> None:
    """Hold full stick at the leg until the gate has stopped the robot."""
    operator.page.get_by_role("tab", name="Centre").click()
    x, y = operator.middle_of("zone")
    start = operator.place

    def held() -> bool:
        asked, allowed = (operator.state["verdict"][name][0] for name in ("asked", "allowed"))
        return asked > 0 and allowed == 0 and abs(operator.state["odometry"]["vx"]) < 0.02

    fingers.put(1, (x, y))
    ahead = (x, y - operator.stick_reach)
    fingers.push(1, ahead, lambda: math.dist(operator.place, start) > 0.4, "0.4 m by odometry")
    fingers.push(1, ahead, held, "the gate to hold before the leg")
    fingers.lift(1)
    assert math.dist(operator.place, start) < 1.1  # 1.35 m to the leg, less the robot's own front


def is_stopped_on_its_way(operator: Person, fingers: Fingers) -> None:
    """Send the robot to the kitchen; stop it with a second finger."""
    operator.until(lambda: operator.state.get("location"), "a robot that knows where it is")
    open_map(operator)
    begin = operator.place

    def go() -> None:
        if not operator.part("places-list").is_visible():
            operator.part("map-places").click()
        operator.part("places-list").get_by_role("button", name="kitchen", exact=True).click()

    operator.insist("going", go, lambda: math.dist(operator.place, begin) > 0.3, "a part of the way")
    expect(operator.part("going-words")).to_contain_text("Drives to “kitchen”")
    fingers.put(1, operator.middle_of("map"))
    fingers.put(2, operator.middle_of("stop"))
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "confirmed standstill")
    assert ended(operator, "going", "stopped")
    fingers.lift(2)
    fingers.lift(1)


def the_log_has_it(operator: Person) -> None:
    """Find it all on the page of the control session."""
    operator.open("/your-data/")
    operator.page.get_by_role("link", name=ROBOT.name).first.click()
    expect(operator.page.get_by_text("ROS 2")).to_have_count(1)
    timeline = operator.part("timeline")
    for said in (SENTENCE, "Wave", "kitchen", "Drive began", "Stop"):
        expect(timeline.locator("li", has_text=said).first).to_be_visible()
