"""Torso and the head's stick on the control page of a simulated robot."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import expect

from tests.browser.people import Person
from tests.browser.test_pages import axe_accepts_everywhere

Arrive = Callable[..., Person]


def at(person: Person, limb: str) -> float:
    """Return the limb's position (m) in the newest state that the page received."""
    place: float = person.state["limbs"][limb]["at_m"]
    return place


def test_the_torso_rises(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    operator.part("robot-open").click()
    axe_accepts_everywhere(operator, "drawer Robot")
    slider = operator.part("torso-to")
    before = at(operator, "torso")
    box = slider.bounding_box()
    assert box is not None
    operator.page.mouse.click(box["x"] + 0.9 * box["width"], box["y"] + box["height"] / 2)
    expect(operator.part("limbs-words")).to_contain_text("Torso")
    operator.until(lambda: at(operator, "torso") > before + 0.03, "a torso that rises")
    operator.part("limbs-cancel").click()
    operator.until(lambda: operator.state["limbs"]["torso"].get("ended"), "the end of the move")
    assert operator.state["limbs"]["torso"]["ended"]["outcome"] == "cancelled"
    assert at(operator, "torso") < 0.3
    operator.release()


def test_the_head_turns_while_its_stick_is_held(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    operator.part("head-open").click()
    axe_accepts_everywhere(operator, "stick of the head")
    box = operator.part("head-pad").bounding_box()
    assert box is not None
    operator.page.mouse.move(box["x"] + 4.0, box["y"] + box["height"] / 2)
    operator.page.mouse.down()
    operator.until(lambda: operator.sent.count("turn_head") > 2, "turns of the head")
    operator.page.mouse.up()
    count = operator.sent.count("turn_head")
    operator.part("head-ahead").click()
    operator.until(lambda: "look_ahead" in operator.sent, "the way back")
    assert operator.sent.count("turn_head") == count
    operator.page.keyboard.down("j")
    operator.until(lambda: operator.sent.count("turn_head") > count + 1, "turns by a key")
    operator.page.keyboard.up("j")
    operator.release()
