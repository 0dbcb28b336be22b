"""A robot moves only while a hand proves that it holds an input: real mouse and keys, in Chromium and Firefox."""

from __future__ import annotations

import time

from tests.browser.hands.conftest import RobotSide
from tests.browser.hands.desk import Window

LEFT = -0.3  # share of the joystick's size: turns on the spot


def grip(page: Window, robot: RobotSide) -> None:
    """Hold the joystick to the left with the main button until the robot turns."""
    hand = page.desk.hand

    def press() -> None:
        hand(
            "mouseup",
            1,
            "mousemove",
            *page.place("zone"),
            "mousedown",
            1,
            "mousemove",
            *page.place("zone", LEFT),
        )

    robot.until_turns(press)


def press(page: Window, robot: RobotSide, key: str) -> None:
    """Hold a key until the robot turns."""
    robot.until_turns(lambda: page.desk.hand("keyup", key, "keydown", key))


def test_a_right_click_does_not_drive(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    hand("mousemove", *page.place("zone"), "click", 3)
    time.sleep(0.3)  # a menu, if there is one, opens
    hand("key", "Escape")
    hand("mousemove", *page.place("zone", LEFT))
    robot.stays_still(0.6)
    hand("mousemove", *page.place("zone"), "mousedown", 3, "mousemove", *page.place("zone", LEFT))
    robot.stays_still(0.6)
    hand("mouseup", 3)
    grip(page, robot)
    hand("mousedown", 3)  # a second button
    robot.until_still(1.5)
    hand("mouseup", 3, "mousemove", *page.place("zone", LEFT, 0.1))
    robot.stays_still(0.6)
    hand("mouseup", 1)
    grip(page, robot)
    hand("mouseup", 1)
    robot.until_still(1.5)


def test_keys_end_while_a_modifier_is_down(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    press(page, robot, "a")
    hand("keydown", "super")
    robot.until_still(1.5)
    hand("keyup", "super")
    robot.stays_still(0.6)  # the key still repeats
    hand("keyup", "a")
    press(page, robot, "a")
    hand("keyup", "a")
    robot.until_still(1.5)


def test_a_key_whose_release_is_lost_ends(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    press(page, robot, "a")
    time.sleep(1.0)  # the key repeats
    hand("key", "F9")
    time.sleep(0.1)
    hand("keyup", "a", "key", "Escape")
    assert robot.until_still(4.0) < 2.0
    robot.stays_still(0.6)


def test_a_mouse_that_rests_ends_and_says_why(page: Window, robot: RobotSide) -> None:
    grip(page, robot)
    asks = "document.querySelector('[data-part=hint]').textContent.startsWith('Still there?')"
    page.until(asks, 5.0)
    page.desk.hand("mousemove", *page.place("zone", LEFT, 0.02))  # a sign
    page.until(f"!({asks})", 2.0)
    page.until("document.querySelector('[data-part=notices]').textContent.includes('no sign of a hand')", 8.0)
    robot.until_still(1.5)
    page.desk.hand("mousemove", *page.place("zone", LEFT, 0.1))
    robot.stays_still(0.6)


def test_a_held_key_goes_on(page: Window, robot: RobotSide) -> None:
    press(page, robot, "a")
    time.sleep(5.0)
    assert page.evaluate("document.querySelector('.zone .knob').style.getPropertyValue('--right')") == "-1"
    page.desk.hand("keyup", "a")
    robot.until_still(1.5)
