"""Beside an open dialog nothing acts but stops, by real keys, in Chromium and Firefox."""

from __future__ import annotations

from tests.browser.hands.conftest import DRIVES, RobotSide
from tests.browser.hands.desk import Window
from tests.browser.hands.test_held_input import STICK_RESTS, press, rests

DIALOGS = "document.querySelectorAll('dialog[open]').length"
AT_PLAY = "document.activeElement === document.querySelector('.motions button.hit, .motions .hit button')"
HELD_S = 0.6


def click(page: Window, part: str) -> None:
    """Press a part of the page by the mouse."""
    page.desk.hand("mousemove", *page.place(part), "click", 1)


def opens(page: Window, keys: str, dialogs: int = 1) -> None:
    """Open a dialog by a key, so that this many are open."""
    page.desk.hand("key", keys)
    page.until(f"{DIALOGS} === {dialogs}", 5.0)


def stops_by_space(page: Window, robot: RobotSide) -> None:
    """Press the key of the stop: the robot takes it."""
    before = robot.state["stop"]["number"]
    page.desk.hand("key", "space")
    robot.until(lambda: robot.state["stop"]["number"] == before + 1, "a stop")


def drives_not(page: Window, robot: RobotSide) -> None:
    """Hold a key that drives: nothing moves."""
    page.desk.hand("keydown", "a")
    robot.stays_still(HELD_S)
    assert page.evaluate(STICK_RESTS)
    page.desk.hand("keyup", "a")


def test_beside_dialogs_only_the_stop_acts(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    press(page, robot, "a")
    opens(page, "question")  # while the key is held
    rests(page, robot)
    hand("keyup", "a")
    drives_not(page, robot)
    stops_by_space(page, robot)  # the focus is in the dialog
    hand("key", "Escape")
    page.until(f"{DIALOGS} === 0", 5.0)
    page.until("!document.querySelector('[data-part=reason-act]').hidden", 5.0)

    click(page, "reason-act")  # asks whether to clear the stop
    page.until(f"{DIALOGS} === 1", 5.0)
    stops_by_space(page, robot)  # presses no button of the dialog
    click(page, "who")  # beside it
    opens(page, "question", 2)
    click(page, "who")
    drives_not(page, robot)
    stops_by_space(page, robot)
    for rest in (1, 0):
        drives_not(page, robot)
        hand("key", "Escape")
        page.until(f"{DIALOGS} === {rest}", 5.0)
    page.until("document.querySelector('[data-part=reason-act]').textContent.startsWith('Clear')", 5.0)
    click(page, "reason-act")
    page.until("document.activeElement.closest('[data-part=clear-dialog]') !== null", 5.0)
    hand("key", "Tab", "key", "Return")
    robot.until(lambda: robot.state["stop"]["state"] == "clear", "a cleared stop")
    press(page, robot, "a")
    hand("keyup", "a")
    rests(page, robot)


def test_the_palette_takes_the_keys_and_gives_the_focus_back(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    page.evaluate(f"void ({AT_PLAY.split('=== ')[1]}).focus()")
    opens(page, "ctrl+k")
    drives_not(page, robot)
    page.until("document.activeElement.value === 'a'", 5.0)
    hand("key", "Escape", "key", "Escape")  # the search, then the palette
    page.until(f"{DIALOGS} === 0 && {AT_PLAY}", 5.0)
    press(page, robot, "a")
    hand("keyup", "a")
    rests(page, robot)


def test_t_takes_no_control_beside_a_dialog(page: Window, robot: RobotSide) -> None:
    hand = page.desk.hand
    page.evaluate("document.querySelector('[data-action=release]').click()")
    page.until(f"!({DRIVES})", 5.0)
    opens(page, "question")
    for _ in range(2):
        hand("key", "t")
        drives_not(page, robot)
        assert not page.evaluate(DRIVES)
        click(page, "who")  # then beside the dialog
    page.until("document.querySelector('[data-part=notices]').textContent.includes('Close the dialog')", 5.0)
    hand("key", "Escape")
    page.until(f"{DIALOGS} === 0", 5.0)
    hand("key", "t")
    page.until(DRIVES, 10.0)
