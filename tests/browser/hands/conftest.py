"""Real browsers with a real hand, in front of the console that all browser tests share."""

from __future__ import annotations

import json
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from robots.shared import wire
from script.stack.client import sign_in
from script.stack.stack import Stack
from tests.browser.hands.desk import Chromium, Desk, Firefox, Window, wait_for

ROBOT = "tiago-2"  # it stands in free space: tests turn it on the spot
TURNS_RADPS = 0.05
DRIVES = "document.querySelector('.control').dataset.drives === 'true'"
TAKE = """[...document.querySelectorAll('[data-part=actions] button')]
  .find((button) => button.textContent.trim() === 'Take control')?.click()"""


class RobotSide:
    """The robot's motion by its odometry: heard by a connection of its own, whatever the page believes."""

    def __init__(self, stack: Stack) -> None:
        self.state: dict[str, Any] = {}
        self._ending = ExitStack()
        self._socket = self._ending.enter_context(
            connect(
                f"{stack.url.replace('http', 'ws', 1)}/ws/robots/{ROBOT}/",
                origin=stack.url,  # type: ignore[arg-type]
                additional_headers={"Cookie": sign_in(stack, "observer")},
                compression=None,
            )
        )
        self._socket.send(wire.encode(wire.Hello(secrets.token_urlsafe(24))), text=True)
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for frame in self._socket:
                message = json.loads(frame)
                if message["t"] == "view":
                    self.state = message["state"]
                    self._socket.send('{"t":"ack"}')
        except ConnectionClosed:
            pass

    def close(self) -> None:
        """End the connection."""
        self._ending.close()
        self._thread.join()

    @property
    def turns(self) -> bool:
        """Whether the robot turns."""
        return abs(self.state["odometry"]["w"]) > TURNS_RADPS

    def until(self, condition: Callable[[], Any], what: str, timeout_s: float = 10.0) -> float:
        """Return how long it took until `condition` was true, s."""
        began = time.monotonic()
        wait_for(condition, f"{what}; the robot: {self.state}", timeout_s)
        return time.monotonic() - began

    def until_turns(self, press: Callable[[], Any]) -> None:
        """Press until the robot turns: on a busy computer the bridge may ask for a stick in the middle first."""
        pressed_s = 0.0

        def turns() -> bool:
            nonlocal pressed_s
            if not self.turns and time.monotonic() > pressed_s + 2.0:
                press()
                pressed_s = time.monotonic()
            return self.turns

        self.until(turns, "turning", 30.0)

    def until_still(self, timeout_s: float = 10.0) -> float:
        """Return how long it took until the robot stood, s."""
        return self.until(lambda: not self.turns, "standstill", timeout_s)

    def stays_still(self, for_s: float) -> None:
        """Assert that the robot does not turn for this long."""
        deadline = time.monotonic() + for_s
        while time.monotonic() < deadline:
            assert not self.turns, self.state["odometry"]
            time.sleep(0.02)


def take_control(window: Window) -> None:
    """Press *Take control* until the page drives: a tab before it may have control for some seconds after its end."""

    def drives() -> bool:
        if not window.evaluate(DRIVES):
            window.evaluate(TAKE)
            time.sleep(0.5)
        return bool(window.evaluate(DRIVES))

    wait_for(drives, "control")


@pytest.fixture(scope="package")
def robot(stack: Stack) -> Iterator[RobotSide]:
    """The robot that the hand drives."""
    side = RobotSide(stack)
    wait_for(lambda: side.state, "the robot's state")
    yield side
    side.close()


@pytest.fixture(scope="package", params=[Chromium, Firefox], ids=lambda kind: kind.name)
def window(stack: Stack, request: pytest.FixtureRequest) -> Iterator[Window]:
    """A browser that shows the robot's page to an operator in control."""
    with Desk() as desk:
        window = request.param(desk)
        for cookie in sign_in(stack, "operator").split("; "):
            window.set_cookie(stack.url, *cookie.split("=", 1))
        window.open(f"{stack.url}/robots/{ROBOT}/")
        yield window


@pytest.fixture
def page(window: Window, robot: RobotSide) -> Iterator[Window]:
    """The page in control, with a stick in the middle and nothing held."""
    take_control(window)
    desk = window.desk
    # At first, Chromium's address bar has the keyboard.
    desk.hand("mousemove", *window.place("who"), "click", 1)
    desk.hand("mousemove", *window.place("zone", up=0.7))
    robot.until(lambda: not robot.turns and robot.state["neutral_needed"] is None, "a free stick")
    yield window
    for button in (1, 3):
        desk.hand("mouseup", button)
    for key in ("a", "Right", "Return", "super"):
        desk.hand("keyup", key)
    robot.until_still()
