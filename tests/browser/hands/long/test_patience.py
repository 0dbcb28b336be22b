"""How long a hand counts that sends no event, in Chromium and Firefox."""

from __future__ import annotations

import time

from tests.browser.hands.conftest import RobotSide
from tests.browser.hands.desk import Window
from tests.browser.hands.test_held_input import LEFT, STICK_RESTS, grip, press, rests


def test_a_key_whose_release_is_lost_ends(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    press(page, robot, "a")
    time.sleep(1.0)  # the key repeats
    hand("key", "F9")
    time.sleep(0.1)
    hand("keyup", "a", "key", "Escape")
    rests(page, robot, 2.0)


def test_a_mouse_that_rests_ends_and_says_why(page: Window, robot: RobotSide) -> None:
    grip(page, robot)
    asks = "document.querySelector('[data-part=reason-title]').textContent.startsWith('Still there?')"
    page.until(asks, 5.0)
    page.desk.hand("mousemove", *page.place("zone", LEFT, 0.02))  # a sign
    page.until(f"!({asks})", 2.0)
    page.until("document.querySelector('[data-part=notices]').textContent.includes('no sign of a hand')", 8.0)
    rests(page, robot)
    page.desk.hand("mousemove", *page.place("zone", LEFT, 0.1))
    robot.stays_still(0.6)


def test_a_held_key_goes_on(page: Window, robot: RobotSide) -> None:
    press(page, robot, "a")
    time.sleep(5.0)
    assert not page.evaluate(STICK_RESTS)
    page.desk.hand("keyup", "a")
    rests(page, robot)
