"""A robot moves only while a hand proves that it holds an input: real mouse and keys, in Chromium and Firefox.

More inputs are in `long`: each costs seconds of computing.
"""

from __future__ import annotations

import time

import pytest

from tests.browser.hands.conftest import RobotSide
from tests.browser.hands.desk import Chromium, Window

STICK_RESTS = "Number(document.querySelector('.zone .knob').style.getPropertyValue('--right')) === 0"
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


def rests(page: Window, robot: RobotSide, within_s: float = 1.5) -> None:
    """Wait until the stick is in the middle and the robot stands: a busy robot may stand for another reason."""
    page.until(STICK_RESTS, within_s)
    robot.until_still(within_s)


def test_a_right_click_does_not_drive(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    hand("mousemove", *page.place("zone"), "mousedown", 3)
    time.sleep(0.3)  # a menu, if there is one, opens and takes the release
    hand("mouseup", 3, "key", "Escape")
    hand("mousemove", *page.place("zone", LEFT))
    robot.stays_still(0.6)
    assert page.evaluate(STICK_RESTS)
    hand("mousemove", *page.place("zone"), "mousedown", 3, "mousemove", *page.place("zone", LEFT))
    robot.stays_still(0.6)
    assert page.evaluate(STICK_RESTS)
    hand("mouseup", 3, "key", "Escape")
    grip(page, robot)
    hand("mousedown", 3)  # a second button
    rests(page, robot)
    hand("mouseup", 3, "mousemove", *page.place("zone", LEFT, 0.1))
    robot.stays_still(0.6)
    hand("mouseup", 1)
    grip(page, robot)
    hand("mouseup", 1)
    rests(page, robot)


@pytest.mark.parametrize("window", [Chromium], ids=["chromium"], indirect=True)
def test_keys_end_while_a_modifier_is_down(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    press(page, robot, "a")
    hand("keydown", "super")
    rests(page, robot)
    hand("keyup", "super")
    robot.stays_still(0.6)  # the key still repeats
    hand("keyup", "a")
    press(page, robot, "a")
    hand("keyup", "a")
    rests(page, robot)
