"""Ways in which a page loses the hand, for each door of motion, in Chromium and Firefox: the robot must stand.

A test presses a door until the robot turns, loses the hand, releases where the page may not hear it, and presses again.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

import pytest

from tests.browser.hands.conftest import RobotSide
from tests.browser.hands.desk import Chromium, Window, wait_for
from tests.browser.hands.test_held_input import LEFT, rests

ENDS_S = 5.0  # the patience with a hand that sends nothing is 4 s
RELEASED_S = 0.5


class Stick:
    """The joystick, held to the left by the main mouse button."""

    def press(self, page: Window) -> None:
        """Begin to hold."""
        hand = page.desk.hand
        hand("mouseup", 1, "mousemove", *page.place("zone"), "mousedown", 1)
        hand("mousemove", *page.place("zone", LEFT))

    def release(self, page: Window) -> None:
        """End the hold."""
        page.desk.hand("mouseup", 1)


class Turn:
    """The button *Turn and look*, held by the main mouse button."""

    def press(self, page: Window) -> None:
        """Begin to hold."""
        page.until("!document.querySelector('[data-part=turn]').hidden")
        page.desk.hand("mouseup", 1, "mousemove", *page.place("turn"), "mousedown", 1)

    def release(self, page: Window) -> None:
        """End the hold."""
        page.desk.hand("mouseup", 1)


class Key:
    """A key that turns the robot. In a menu, a letter would choose an entry; Alt+Left would leave the page."""

    def press(self, page: Window) -> None:
        """Begin to hold."""
        page.desk.hand("keyup", "Right", "keydown", "Right")

    def release(self, page: Window) -> None:
        """End the hold."""
        page.desk.hand("keyup", "Right")


class Enter:
    """Enter on the button *Turn and look*."""

    def press(self, page: Window) -> None:
        """Begin to hold."""
        page.evaluate("document.querySelector('[data-part=turn]').focus()")
        page.desk.hand("keyup", "Return", "keydown", "Return")

    def release(self, page: Window) -> None:
        """End the hold."""
        page.desk.hand("keyup", "Return")


Door = Stick | Turn | Key | Enter
Loss = Callable[[Window, Door], None]
MOUSE: tuple[Door, ...] = (Stick(), Turn())
KEYS: tuple[Door, ...] = (Key(), Enter())


def presses(*words: str | float) -> Loss:
    """Press these while the door is held, release the door, then press Escape."""

    def lose(page: Window, door: Door) -> None:
        page.desk.hand(*words)
        time.sleep(RELEASED_S)
        door.release(page)
        page.desk.hand("key", "Escape")

    return lose


def holds(modifier: str) -> Loss:
    """Release the door while a modifier key is down."""

    def lose(page: Window, door: Door) -> None:
        page.desk.hand("keydown", modifier)
        time.sleep(RELEASED_S)
        door.release(page)
        page.desk.hand("keyup", modifier)

    return lose


def menu_elsewhere(page: Window, door: Door) -> None:
    """Release the door while a menu of the page is open."""
    page.desk.hand("mousemove", *page.place("who"), "click", 3)
    time.sleep(RELEASED_S)
    door.release(page)
    page.desk.hand("key", "Escape")


def address_bar(page: Window, door: Door) -> None:
    """Release the door while the address bar has the keyboard, then return to the page."""
    presses("key", "F6")(page, door)
    page.desk.hand("mousemove", *page.place("who"), "click", 1)


def hidden(page: Window, door: Door) -> None:
    """Release the door while the window is an icon."""
    window = page.desk.hand("getactivewindow").strip()
    page.desk.hand("key", "F10")
    time.sleep(RELEASED_S)
    door.release(page)
    time.sleep(RELEASED_S)
    page.desk.hand("windowmap", "--sync", window, "windowactivate", "--sync", window)


def unfocused(page: Window, door: Door) -> None:
    """Release the door while no window has the focus."""
    window = page.desk.hand("getactivewindow").strip()
    root = page.desk.hand("search", "--maxdepth", "0", ".*").split()[0]
    page.desk.hand("windowfocus", root)
    time.sleep(RELEASED_S)
    door.release(page)
    page.desk.hand("windowactivate", "--sync", window)


def a_dialog(page: Window, door: Door) -> None:
    """Release the door while a dialog of the browser waits for an answer."""
    page.evaluate("void setTimeout(() => confirm('Really?'))")
    time.sleep(2 * RELEASED_S)
    door.release(page)
    # The repeats of a held Enter answer it.
    wait_for(lambda: page.dismiss() or isinstance(door, Enter), "a dialog")


def a_dialog_of_the_page(page: Window, door: Door) -> None:
    """Open the page's own dialog while the door is held."""
    page.evaluate("document.querySelector('[data-part=clear-dialog]').showModal()")
    time.sleep(RELEASED_S)
    door.release(page)
    page.evaluate("document.querySelector('[data-part=clear-dialog]').close()")


def print_preview(page: Window, door: Door) -> None:
    """Release the door while the browser shows what it would print."""
    page.evaluate("void setTimeout(() => print(), 100)")
    time.sleep(4 * RELEASED_S)
    door.release(page)
    page.desk.hand("key", "Escape")
    time.sleep(2 * RELEASED_S)


def frozen(page: Window, door: Door) -> None:
    """Stop the browser's processes for 3 s, and release the door meanwhile."""
    browser = page.process.pid
    os.killpg(browser, signal.SIGSTOP)
    time.sleep(3.0)
    door.release(page)
    os.killpg(browser, signal.SIGCONT)


def full_screen(page: Window, door: Door) -> None:
    """Change the size of everything while the door is held."""
    page.desk.hand("key", "F11")
    time.sleep(2 * RELEASED_S)
    door.release(page)
    page.desk.hand("key", "F11")
    time.sleep(2 * RELEASED_S)


def workspace(page: Window, door: Door) -> None:
    """Release the door while another workspace is shown."""
    page.desk.hand("set_num_desktops", 2, "set_desktop", 1)
    time.sleep(RELEASED_S)
    door.release(page)
    page.desk.hand("set_desktop", 0)
    time.sleep(RELEASED_S)


def dead_key(page: Window, door: Door) -> None:
    """Release the door while a dead key waits for its letter."""
    page.desk.layout("us", "-variant", "intl")
    page.desk.hand("key", "dead_acute")
    door.release(page)
    time.sleep(RELEASED_S)
    page.desk.hand("key", "dead_acute")
    page.desk.layout("us")


def clicks_on(element: str) -> Loss:
    """Release the door while a new element of the page, which a click opened, has the keyboard."""

    def lose(page: Window, door: Door) -> None:
        page.evaluate(f"""(() => {{
          const made = {element};
          made.dataset.part = "opened";
          made.style.cssText = "position: fixed; left: 45%; top: 45%; z-index: 9";
          document.body.append(made);
        }})()""")
        page.desk.hand("mousemove", *page.place("opened"), "click", 1)
        time.sleep(3 * RELEASED_S)
        door.release(page)
        page.desk.hand("key", "Escape")
        time.sleep(RELEASED_S)
        page.evaluate("document.querySelector('[data-part=opened]').remove()")

    return lose


def drag_of_text(page: Window, door: Door) -> None:
    """Release the door while the mouse drags a text of the page."""
    page.evaluate("getSelection().selectAllChildren(document.querySelector('[data-part=who]'))")
    x, y = page.place("who")
    page.desk.hand("mousemove", x, y, "mousedown", 1)
    for step in range(6):
        page.desk.hand("mousemove", x + 10 * step, y - 10 * step)
        time.sleep(0.05)
    time.sleep(RELEASED_S)
    door.release(page)
    page.desk.hand("mouseup", 1)
    page.evaluate("getSelection().empty()")


LOSSES: dict[str, tuple[Loss, tuple[Door, ...]]] = {
    "second button": (presses("click", 3), MOUSE),
    "middle button": (presses("click", 2), MOUSE),
    "menu": (menu_elsewhere, (Key(),)),  # a held Enter would choose from the menu
    "menu key": (presses("key", "Menu"), (*MOUSE, Key())),
    "address bar": (address_bar, KEYS),
    "menu of the window system": (presses("key", "F9"), KEYS),
    "Ctrl": (holds("ctrl"), (*MOUSE, Key())),
    "Alt": (holds("alt"), (*MOUSE, Key())),
    "Super": (holds("super"), (*MOUSE, *KEYS)),
    "AltGr": (holds("ISO_Level3_Shift"), (*MOUSE, Key())),
    "icon": (hidden, (*MOUSE, *KEYS)),
    "focus": (unfocused, (*MOUSE, *KEYS)),
    "dialog of the browser": (a_dialog, (*MOUSE, *KEYS)),
    "dialog of the page": (a_dialog_of_the_page, (*MOUSE, *KEYS)),
    "print": (print_preview, (Stick(), Key())),
    "frozen": (frozen, (*MOUSE, *KEYS)),
    "full screen": (full_screen, (Stick(), Key())),
    "find bar": (presses("key", "F3"), (Key(),)),
    "workspace": (workspace, (Stick(), Key())),
    "dead key": (dead_key, (Key(),)),
    "list": (clicks_on("Object.assign(document.createElement('select'), {size: 1})"), (Key(),)),
    "choice of a file": (
        clicks_on("Object.assign(document.createElement('input'), {type: 'file'})"),
        (Key(),),
    ),
    "drag of text": (drag_of_text, (Key(),)),
}
CASES = [
    pytest.param(lose, door, id=f"{name} while {type(door).__name__}")
    for name, (lose, doors) in LOSSES.items()
    for door in doors
]


@pytest.mark.parametrize(("lose", "door"), CASES)
def test_a_lost_hand_ends_motion(page: Window, robot: RobotSide, lose: Loss, door: Door) -> None:
    robot.until_turns(lambda: door.press(page))
    lose(page, door)
    rests(page, robot, ENDS_S)
    page.desk.hand("mousemove", *page.place("zone", LEFT, 0.1))
    robot.stays_still(1.0)
    robot.until_turns(lambda: door.press(page))
    door.release(page)
    robot.until_still(ENDS_S)


@pytest.mark.parametrize(
    "lose",
    [pytest.param(LOSSES[name][0], id=name) for name in ("focus", "dialog of the browser", "print", "Super")],
)
def test_a_slider_whose_hand_is_lost_sends_no_goal(page: Window, robot: RobotSide, lose: Loss) -> None:
    if page.evaluate("document.querySelector('[data-part=torso-to]').getBoundingClientRect().width === 0"):
        page.evaluate("document.querySelector('[data-part=robot-open]').click()")
    goal = robot.state["limbs"]["torso"].get("to_m")
    for target in (0.3, -0.3):  # one of both is elsewhere than the robot
        x, y = page.place("torso-to", target)
        page.desk.hand("mousemove", *page.place("torso-to"), "mousedown", 1, "mousemove", x, y)
        time.sleep(RELEASED_S)
        lose(page, Stick())
        page.desk.hand("mousemove", x + 20, y, "mousemove", *page.place("who"), "click", 1)
        time.sleep(RELEASED_S)
        assert robot.state["limbs"]["torso"].get("to_m") == goal


class Fingers:
    """Fingers on Chromium's page, by its own protocol: nothing emulates the focus."""

    def __init__(self, page: Window) -> None:
        self._page = page
        self._is_down = False

    def touch(self, point: dict[str, float]) -> None:
        """Begin a touch; another one ends first."""
        if self._is_down:
            self.send("touchCancel")
        self._is_down = True
        self.send("touchStart", point)

    def at(self, right: float, up: float = 0.0) -> dict[str, float]:
        """Return a point of the joystick."""
        middle, corner = (
            self._page.place("zone", right, up),
            self._page.evaluate("[screenX, screenY + outerHeight - innerHeight]"),
        )
        return {"x": middle[0] - corner[0], "y": middle[1] - corner[1]}

    def send(self, kind: str, *points: dict[str, float]) -> None:
        """Send one touch event."""
        self._page.call("Input.dispatchTouchEvent", type=kind, touchPoints=list(points))


def test_a_finger_that_rests_is_asked_and_ends(page: Window, robot: RobotSide) -> None:
    if not isinstance(page, Chromium):
        return  # Firefox has no touches on this screen
    fingers = Fingers(page)

    def press() -> None:
        fingers.touch(fingers.at(0.0))
        fingers.send("touchMove", fingers.at(LEFT))

    robot.until_turns(press)
    time.sleep(2.0)  # a long touch: it must open no menu
    assert robot.turns
    page.until("document.querySelector('[data-part=notices]').textContent.includes('no sign of a hand')", 8.0)
    robot.until_still(ENDS_S)
    fingers.send("touchMove", fingers.at(LEFT, 0.1))
    robot.stays_still(1.0)
    fingers.send("touchEnd")


def test_a_pen_drives_by_its_tip_alone(page: Window, robot: RobotSide) -> None:
    if not isinstance(page, Chromium):
        return  # Firefox has no pens on this screen
    fingers = Fingers(page)

    def pen(kind: str, place: dict[str, float], buttons: int) -> None:
        button = "none" if kind == "mouseMoved" else "right" if buttons == 2 else "left"
        page.call(
            "Input.dispatchMouseEvent", type=kind, button=button, buttons=buttons, pointerType="pen", **place
        )

    pen("mousePressed", fingers.at(0.0), 2)
    pen("mouseMoved", fingers.at(LEFT), 2)
    robot.stays_still(1.0)
    pen("mouseReleased", fingers.at(LEFT), 0)

    def press() -> None:
        pen("mouseReleased", fingers.at(0.0), 0)
        pen("mousePressed", fingers.at(0.0), 1)
        pen("mouseMoved", fingers.at(LEFT), 1)

    robot.until_turns(press)
    pen("mouseMoved", fingers.at(LEFT, 0.02), 3)  # the button at its side
    robot.until_still(ENDS_S)
    pen("mouseReleased", fingers.at(LEFT), 0)
