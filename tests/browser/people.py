"""A person at a browser: actions on pages, and the messages between page and console."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, WebSocket, expect

from script.stack.client import Console
from script.stack.database import with_tables
from script.stack.places import REPOSITORY
from script.stack.stack import PracticeRobot, SimulatedRobot, Stack
from tests.processes import until

PutBack = Callable[..., None]
PATIENCE_S = 30.0
expect.set_options(timeout=1000.0 * PATIENCE_S)
ANSWERS_S, TASK_S = 6.0, 120.0
POLL_MS = 50
SIGN_S = 1.0  # a held key repeats; much slower than real keys, so that a test may keep one down for seconds
MADE_UP_LANGUAGE = (Path(__file__).parent / "made_up_language.js").read_text()
LICHTBLICK = Path(__file__).parent / "lichtblick"  # stands in for a build
# Mark the hints for newcomers as read: this person has used the console before.
HINTS_SEEN = """if (location.protocol.startsWith("http")) {
  const kept = JSON.parse(localStorage.getItem("fleet-console") ?? "{}");
  localStorage.setItem("fleet-console", JSON.stringify({ ...kept, [%s]: true }));
}"""


class Person:
    """A person with an account of `role`, in a separate browser context.

    A `newcomer` sees the hints of a first visit, and the newcomer's browser may keep pages for use offline.
    `heard` has the newest message of each kind from the server (`picture`: the header of a camera's picture),
    `drives` all drive messages of the page.
    """

    def __init__(
        self,
        stack: Console,
        browser: Browser,
        role: str,
        *,
        width: int = 1440,
        height: int = 900,
        touch: bool = False,
        theme: str = "light",
        newcomer: bool = False,
    ) -> None:
        self.stack = stack
        self.account = stack.accounts[role]
        self.context = browser.new_context(
            has_touch=touch,
            reduced_motion="reduce",
            # A service worker would answer some requests that a test wants to answer.
            service_workers="allow" if newcomer else "block",
            ignore_https_errors=stack.certificate is not None,  # like a person who ignores the warning
        )
        if not newcomer:
            self.context.add_init_script(HINTS_SEEN % json.dumps(f"hints_seen {self.account.username}"))
        self.page: Page = self.context.new_page()
        self.complaints: list[str] = []
        self.heard: dict[str, Any] = {}
        self.drives: list[dict[str, Any]] = []
        self.sent: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on(
            "console", lambda line: self.complaints.append(line.text) if line.type == "error" else None
        )
        self.page.on("websocket", self._listen)
        self.prepare(width=width, height=height, theme=theme)

    def prepare(self, *, width: int = 1440, height: int = 900, theme: str = "light") -> None:
        """Set the window's size (pixels) and theme, and forget all messages."""
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.emulate_media(color_scheme=theme, forced_colors="null")  # type: ignore[arg-type]
        for said in (self.complaints, self.heard, self.drives, self.sent):
            said.clear()

    def clear_browser(self) -> None:
        """Leave the page and clear its storage, for the next test with this role."""
        self.open("/healthz")
        self.page.evaluate("localStorage.clear(); sessionStorage.clear()")
        self.page.mouse.move(-1, -1)

    def leave(self) -> None:
        """Close the browser context."""
        self.context.close()

    def _listen(self, socket: WebSocket) -> None:
        socket.on("framereceived", self._received)
        socket.on("framesent", self._sent)

    def _received(self, frame: str | bytes) -> None:
        if isinstance(frame, bytes):  # the header's length, the header, and a camera's picture
            self.heard["picture"] = json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "big")])
            return
        message = json.loads(frame)
        self.heard[message["t"]] = message

    def _sent(self, frame: str | bytes) -> None:
        message = json.loads(frame)
        self.sent.append(message["t"])
        if message["t"] == "drive":
            self.drives.append(message)

    # --- pages -----------------------------------------------------------------------------------

    def open(self, path: str) -> None:
        """Go to a page of the console."""
        self.page.goto(self.stack.url + path)

    def sign_in(self) -> None:
        """Sign in by the page."""
        self.open("/accounts/sign-in/")
        self.page.get_by_label("User name").fill(self.account.username)
        self.page.get_by_label("Password", exact=True).fill(self.account.password)
        self.page.get_by_role("button", name="Sign in", exact=True).click()
        self.page.wait_for_url(self.stack.url + "/")

    def watch(self, slug: str) -> None:
        """Open a robot's page and wait for its first picture."""
        self.heard.clear()
        self.open(f"/robots/{slug}/")
        self.until(lambda: "view" in self.heard and "control" in self.heard, "the first picture")

    def part(self, name: str) -> Locator:
        """The element that the page's script knows by this name."""
        return self.page.locator(f"[data-part='{name}']")

    def press(self, name: str) -> None:
        """Press the visible button of this name."""
        self.page.get_by_role("button", name=name).click()

    def open_drawer(self, name: str) -> None:
        """Open a drawer of a small screen. A wide screen always shows its contents."""
        opener = self.page.get_by_role("button", name=name, exact=True)
        if opener.is_visible() and opener.get_attribute("aria-expanded") == "false":
            opener.click()

    # --- control ---------------------------------------------------------------------------------

    def take(self, slug: str) -> None:
        """Open a robot's page, clear the stop if there is one, and take control."""
        self.watch(slug)
        self.press("Take control")
        if self.state["stop"]["state"] != "clear":
            self.clear()
        self.until_in_control()

    def until_in_control(self) -> None:
        """Wait until the bridge accepts drive input of this page."""
        self.until(lambda: self.control["state"] == "yours", "control")
        fence = self.control["fence"]
        self.until(
            lambda: self.state["fence"] == fence and self.state["neutral_needed"] is None, "a free stick"
        )

    def clear(self) -> None:
        """Clear the stop through the dialog."""
        self.press("Clear stop…")
        self.page.get_by_role("dialog").get_by_role("button", name="Clear stop").click()
        self.until(lambda: self.state["stop"]["state"] == "clear", "the latch to clear")

    def forget(self) -> None:
        """Make the robot forget what it saw: it knows nothing behind it, also if it turned in an earlier test."""
        self.part("forget").evaluate("(button) => button.click()")
        self.page.get_by_role("button", name="Forget", exact=True).click()
        self.until(
            lambda: "behind_unseen" in [limit["code"] for limit in self.state["verdict"]["limits"]],
            "a robot that knows nothing behind it",
        )

    def release(self) -> None:
        """Release control."""
        self.part("actions").get_by_role("button", name="Release").click()
        self.until(lambda: self.control["state"] == "free", "control to be free")

    @property
    def control(self) -> dict[str, Any]:
        """The newest message about control."""
        control: dict[str, Any] = self.heard["control"]
        return control

    @property
    def state(self) -> dict[str, Any]:
        """The robot's newest state."""
        state: dict[str, Any] = self.heard["view"]["state"]
        return state

    @property
    def place(self) -> tuple[float, float]:
        """The robot's place by odometry, m."""
        odometry = self.state["odometry"]
        return odometry["x"], odometry["y"]

    @property
    def last_drive(self) -> tuple[float, float, float]:
        """The last drive message: forward, left, turn."""
        drive = self.drives[-1]
        return drive["x"], drive["y"], drive["w"]

    @property
    def rests(self) -> bool:
        """Whether the page's stick is in the middle."""
        return bool(self.drives) and self.last_drive == (0, 0, 0)

    def middle_of(self, name: str) -> tuple[float, float]:
        """Return the middle of an element, in pixels of the window."""
        box = self.part(name).bounding_box()
        assert box is not None, f"{name} is not on the page"
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    @property
    def stick_reach(self) -> float:
        """Pixels from the joystick's middle to beyond full stick."""
        box = self.part("zone").bounding_box()
        assert box is not None
        return 0.45 * min(box["width"], box["height"])

    def drag_stick(self, right: float, up: float) -> None:
        """Press the mouse on the joystick's middle and move it to this position, still down; 1 is beyond full stick."""
        self.page.mouse.move(*self.middle_of("zone"))
        self.page.mouse.down()
        self.move_stick(right, up)

    def move_stick(self, right: float, up: float) -> None:
        """Move the mouse to this position on the joystick; 1 is beyond full stick."""
        x, y = self.middle_of("zone")
        self.page.mouse.move(x + self.stick_reach * right, y - self.stick_reach * up)

    def push(self, *keys: str, until: Callable[[], Any], what: str) -> None:
        """Hold these keys until a condition is true, and keep them down.

        On a busy computer a scan can be late, and the gate asks for a neutral stick, or the page itself stood still and
        let go: then release and press the keys. The last key repeats, as at a real keyboard: a key that is silent for
        too long counts as released.
        """
        sign_s = 0.0

        def there() -> bool:
            if until():
                return True
            if self.state["neutral_needed"] or (time.monotonic() > sign_s and self.rests):
                self.let_go(*keys)
                self.until(lambda: self.state["neutral_needed"] is None, "a free stick")
                press()
            elif time.monotonic() > sign_s:
                press(keys[-1])
            return False

        def press(*pressed: str) -> None:
            nonlocal sign_s
            for key in pressed or keys:
                self.page.keyboard.down(key)
            sign_s = time.monotonic() + SIGN_S

        press()
        self.until(there, what)

    def drive(self, *keys: str, metres: float) -> None:
        """Hold these keys until the robot has moved this far by odometry, and keep them down."""
        start = self.place
        self.push(*keys, until=lambda: math.dist(self.place, start) > metres, what=f"{metres} m by odometry")

    def let_go(self, *keys: str) -> None:
        """Release these keys."""
        for key in keys:
            self.page.keyboard.up(key)

    # --- waiting ---------------------------------------------------------------------------------

    def until(self, condition: Callable[[], Any], what: str, timeout_s: float = PATIENCE_S) -> None:
        """Run the page until `condition` is true."""
        deadline = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > deadline:
                newest = self.heard.get("view", {}).get("state")
                raise AssertionError(f"not within {timeout_s} s: {what}; robot: {newest}")
            self.page.wait_for_timeout(POLL_MS)

    def insist(self, task: str, begin: Callable[[], None], until: Callable[[], bool], what: str) -> None:
        """Begin a task, until a condition is true; again if it is refused or given up: a busy computer is late."""

        def there() -> bool:
            if not until() and not self.state.get(task):
                begin()
                with suppress(AssertionError):
                    self.until(lambda: self.state.get(task) or until(), task, timeout_s=ANSWERS_S)
            return until()

        self.until(there, what, timeout_s=TASK_S)

    def fold_arm(self) -> None:
        """Move the robot's arm home unless it is there; again if a busy computer's late laser data block the motion."""

        def answered() -> bool:
            # A press immediately after the end of a motion counts as a cancel and is refused.
            return bool(self.state["motion"]) or self.heard["refused"]["of"] in ("play", "play_cancel")

        deadline = time.monotonic() + PATIENCE_S
        self.until(lambda: self.state["motion"] is None, "the end of a motion")
        while self.state["arm"]:
            assert time.monotonic() < deadline, f"not folded: {self.heard['refused']}"
            self.heard["refused"] = {"of": None}
            self.press("Play Home")
            self.until(answered, "the motion, or why not")
            self.until(lambda: self.state["motion"] is None, "its end")

    def until_driven(self, start: tuple[float, float], metres: float) -> None:
        """Wait until odometry is this far from `start`."""
        self.until(lambda: math.dist(self.place, start) > metres, f"{metres} m by odometry")

    def until_still(self) -> None:
        """Wait for standstill by odometry."""
        self.until(
            lambda: all(abs(self.state["odometry"][axis]) < 0.02 for axis in ("vx", "vy", "w")), "standstill"
        )


@contextmanager
def running_stack(folder: Path, robots: Sequence[PracticeRobot]) -> Iterator[Stack]:
    """A console with these robots, for the length of a `with` block."""
    with_tables(folder)
    stack = Stack(folder, robots=robots, settings={"FLEET_LICHTBLICK": str(LICHTBLICK)})
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("DJANGO_SETTINGS_MODULE", raising=False)  # the stack runs the product's settings
        stack.launch()
    try:
        stack.wait_ready()
        yield stack
    finally:
        stack.end_processes()


@contextmanager
def robot_side(robot: SimulatedRobot, role: str, said: Path) -> Iterator[subprocess.Popen[str]]:
    """A rospy process at the robot (tests/browser/robot_side.py); its output goes to the file `said`."""
    with said.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.browser.robot_side", role],
            cwd=REPOSITORY, env=robot.environment, stdin=subprocess.PIPE, stdout=file, text=True,
        )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@contextmanager
def putting_back(robot: SimulatedRobot, folder: Path) -> Iterator[PutBack]:
    """A function that puts this robot to its start, for the length of a `with` block."""
    times, said = 0, folder / robot.plan.slug
    with robot_side(robot, "start", said) as side:

        def put_back(pose: tuple[float, float, float] = robot.plan.pose) -> None:
            nonlocal times
            times += 1
            assert side.stdin is not None
            side.stdin.write("{} {} {}\n".format(*pose))
            side.stdin.flush()
            until(lambda: said.read_text().count("there") == times, f"{robot.plan.name} at its start")

        yield put_back


@contextmanager
def faults_of(robot: SimulatedRobot, folder: Path) -> Iterator[Callable[[str], None]]:
    """Yield a function that sets the simulated robot's faults by names, until the end of the `with` block."""
    with robot_side(robot, "faults", folder / "said") as process:
        assert process.stdin is not None

        def begin(names: str) -> None:
            assert process.stdin is not None
            process.stdin.write(f"{names}\n")
            process.stdin.flush()

        yield begin
        begin("none")
        process.stdin.close()
        process.wait(timeout=20.0)


class Fingers:
    """Several parallel touches on a touch screen."""

    def __init__(self, person: Person) -> None:
        self._person = person
        self._screen = person.context.new_cdp_session(person.page)
        self._down: dict[int, tuple[float, float]] = {}

    def put(self, finger: int, place: tuple[float, float]) -> None:
        """Put a finger down."""
        self._down[finger] = place
        self._send("touchStart")

    def move(self, finger: int, place: tuple[float, float]) -> None:
        """Move a finger that is down."""
        self._down[finger] = place
        self._send("touchMove")

    def lift(self, finger: int) -> None:
        """Lift a finger; the others stay down."""
        lifted = {finger: self._down.pop(finger)}
        self._send("touchEnd", lifted if self._down else {})  # the last finger: an empty list

    def tap(self, place: tuple[float, float]) -> None:
        """Touch this place for a short time."""
        self.put(0, place)
        self.lift(0)

    def push(self, finger: int, place: tuple[float, float], until: Callable[[], Any], what: str) -> None:
        """Move a finger to this place until a condition is true, and keep it there.

        On a busy computer odometry can be late, and the gate asks for a neutral stick: then move by way of the middle.
        The finger trembles, as real ones do: one that is silent for too long counts as lifted.
        """
        person = self._person
        middle = person.middle_of("zone")
        tremble = itertools.cycle((0, 1))
        pressed_s = time.monotonic()

        def there() -> bool:
            nonlocal pressed_s
            if person.rests and time.monotonic() > pressed_s + SIGN_S:  # the page stood still, and let go
                self.lift(finger)
                self.put(finger, middle)
                pressed_s = time.monotonic()
            if person.state["neutral_needed"]:
                self.move(finger, middle)
                person.until(lambda: person.state["neutral_needed"] is None, "a free stick")
            self.move(finger, (place[0], place[1] + next(tremble)))
            return bool(until())

        self.move(finger, place)
        person.until(there, what)

    def _send(self, kind: str, points: dict[int, tuple[float, float]] | None = None) -> None:
        shown = self._down if points is None else points
        touches = [{"x": x, "y": y, "id": finger} for finger, (x, y) in shown.items()]
        self._screen.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})
