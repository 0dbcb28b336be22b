"""A desk with a screen of its own: real windows that gain and lose the focus, and a hand on mouse and keyboard.

Playwright tells a page that it always has the focus, and its input does not pass the window system. Here plain
browsers run under Xvfb with a window manager, and xdotool moves mouse and keys.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, TypeVar

from websockets.sync.client import ClientConnection, connect

from script.stack.processes import Child

START_S = 60.0  # limit for a slow computer
POLL_S = 0.02
Found = TypeVar("Found")
SCREEN = "1280x800x24"

# F9 opens a menu of the window system, which takes the keyboard: a page does not hear of keys that are released
# meanwhile. F10 hides the window.
OPENBOX = """<?xml version="1.0"?>
<openbox_config xmlns="http://openbox.org/3.4/rc">
  <focus><focusNew>yes</focusNew><followMouse>no</followMouse></focus>
  <theme><titleLayout></titleLayout></theme>
  <keyboard>
    <keybind key="F9"><action name="ShowMenu"><menu>client-list-menu</menu></action></keybind>
    <keybind key="F10"><action name="Iconify"/></keybind>
  </keyboard>
  <mouse/>
  <applications><application type="normal"><maximized>yes</maximized><decor>no</decor></application></applications>
</openbox_config>
"""


def wait_for(look: Callable[[], Found], what: str, timeout_s: float = START_S) -> Found:
    """Return the first true result of `look`.

    Raises:
        AssertionError: none came within `timeout_s`.

    """
    deadline = time.monotonic() + timeout_s
    while not (found := look()):
        assert time.monotonic() < deadline, f"not within {timeout_s} s: {what}"
        time.sleep(POLL_S)
    return found


class Desk:
    """A screen with a window manager; `hand(...)` does one thing with mouse or keyboard."""

    def __init__(self) -> None:
        self.ending = ExitStack()
        self.folder = Path(self.ending.enter_context(tempfile.TemporaryDirectory(prefix="fleet-desk-")))
        self.environment = {
            **os.environ,
            "HOME": str(self.folder),
            "XDG_CONFIG_HOME": str(self.folder / "config"),
        }
        self.environment.pop("DBUS_SESSION_BUS_ADDRESS", None)

    def __enter__(self) -> Desk:
        read, write = os.pipe()
        with os.fdopen(read) as said:
            self.start(
                "Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp", fds=(write,)
            )
            os.close(write)
            self.environment["DISPLAY"] = f":{said.readline().strip()}"
        settings = self.folder / "openbox.xml"
        settings.write_text(OPENBOX)
        self.start("openbox", "--config-file", str(settings), "--sm-disable")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.ending.close()

    def start(self, *command: str, fds: tuple[int, ...] = ()) -> Child:
        """Start a program on this screen; it ends with the desk, and also when the test is killed."""
        name = Path(command[0]).name
        child = Child(name, command, env=self.environment, log=self.folder / f"{name}.log", fds=fds)
        self.ending.callback(child.kill_group)
        return child

    def hand(self, *words: str | float) -> str:
        """Run xdotool: `hand("keydown", "w")`, `hand("mousemove", 100, 200, "click", 3)`."""
        words_ = [str(word) for word in words]
        return subprocess.run(
            ["xdotool", *words_], env=self.environment, check=True, capture_output=True, text=True
        ).stdout

    def layout(self, *words: str) -> None:
        """Choose the layout of the keyboard: `layout("us", "-variant", "intl")`."""
        subprocess.run(["setxkbmap", *words], env=self.environment, check=True)


class Window:
    """A browser's window on a desk, with one page."""

    name: ClassVar[str]
    process: Child
    _socket: ClientConnection

    def __init__(self, desk: Desk) -> None:
        self.desk = desk
        self.profile = Path(tempfile.mkdtemp(dir=desk.folder))
        self._numbers = itertools.count(1)
        self._begin()

    def _begin(self) -> None:
        raise NotImplementedError

    def open(self, url: str) -> None:
        """Go to a page and wait for its end of loading."""
        raise NotImplementedError

    def evaluate(self, expression: str) -> Any:
        """Return the JSON value of an expression in the page."""
        raise NotImplementedError

    def set_cookie(self, url: str, name: str, value: str) -> None:
        """Give the browser a session's cookie."""
        raise NotImplementedError

    def dismiss(self) -> bool:
        """Answer no to the browser's own dialog, and return whether one was open.

        Firefox opens it without the keyboard's focus while a key is held, so that no key could answer it.
        """
        raise NotImplementedError

    def call(self, method: str, **parameters: Any) -> Any:
        """Send one command of the browser's own protocol and return its result."""
        answer = self._ask(method, **parameters)
        assert "result" in answer, answer
        return answer["result"]

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send one command; return its answer, also a refusal."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while (answer := json.loads(self._socket.recv(timeout=START_S))).get("id") != number:
            pass  # an event
        return dict(answer)

    def place(self, part: str, right: float = 0.0, up: float = 0.0) -> tuple[int, int]:
        """Return a pixel of the screen: the middle of a part of the control page, moved by shares of its size."""
        x, y = self.evaluate(f"""(() => {{
          const box = document.querySelector("[data-part={part}]").getBoundingClientRect();
          const x = window.mozInnerScreenX ?? screenX;
          const y = window.mozInnerScreenY ?? screenY + outerHeight - innerHeight;
          return [x + box.left + box.width * (0.5 + {right}), y + box.top + box.height * (0.5 - {up})];
        }})()""")
        return round(x), round(y)

    def until(self, expression: str, timeout_s: float = START_S) -> Any:
        """Return the first true value of an expression in the page."""
        return wait_for(lambda: self.evaluate(expression), expression, timeout_s)

    def _address(self, mark: str) -> str:
        """Return the rest of the line with this mark that the browser says at its start."""
        log = self.process.log
        assert log is not None

        def said() -> str | None:
            lines = [line for line in log.read_text(errors="replace").splitlines() if mark in line]
            return lines[0].split(mark)[1].strip() if lines else None

        address = wait_for(said, mark)
        assert address is not None
        return address


class Chromium(Window):
    """Debian's Chromium, by the DevTools protocol; nothing emulates the focus."""

    name = "chromium"

    def _begin(self) -> None:
        self.process = self.desk.start(
            "/usr/bin/chromium", f"--user-data-dir={self.profile}", "--remote-debugging-port=0",
            "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--password-store=basic", "about:blank",
        )  # fmt: skip
        browser = self._address("DevTools listening on ").removeprefix("ws://").split("/")[0]

        def page() -> str | None:
            with urllib.request.urlopen(f"http://{browser}/json/list") as answer:
                pages = [each for each in json.load(answer) if each["type"] == "page"]
            return pages[0]["webSocketDebuggerUrl"] if pages else None

        self._socket = self.desk.ending.enter_context(connect(wait_for(page, "a page"), max_size=None))
        self.call("Page.enable")

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)
        wait_for(lambda: self._is_loaded(url), url)

    def _is_loaded(self, url: str) -> bool:
        return bool(self.evaluate("location.href !== 'about:blank' && document.readyState === 'complete'"))

    def evaluate(self, expression: str) -> Any:
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)[
            "result"
        ].get("value")

    def set_cookie(self, url: str, name: str, value: str) -> None:
        self.call("Network.setCookie", url=url, name=name, value=value)

    def dismiss(self) -> bool:
        return "result" in self._ask("Page.handleJavaScriptDialog", accept=False)


class Firefox(Window):
    """Debian's Firefox, by WebDriver BiDi, without the settings that make its windows believe in the focus."""

    name = "firefox"

    def _begin(self) -> None:
        (self.profile / "user.js").write_text(
            "\n".join(f"user_pref({json.dumps(key)}, {json.dumps(value)});" for key, value in QUIET.items())
        )
        self.process = self.desk.start(
            "/usr/bin/firefox-esr", "--profile", str(self.profile), "--new-instance", "--remote-debugging-port=0",
            "about:blank",
        )  # fmt: skip
        address = self._address("WebDriver BiDi listening on ")
        self._socket = self.desk.ending.enter_context(connect(f"{address}/session", max_size=None))
        # Tests answer dialogs.
        self.call(
            "session.new", capabilities={"alwaysMatch": {"unhandledPromptBehavior": {"default": "ignore"}}}
        )
        self._page = self.call("browsingContext.getTree")["contexts"][0]["context"]

    def open(self, url: str) -> None:
        self.call("browsingContext.navigate", context=self._page, url=url, wait="complete")

    def evaluate(self, expression: str) -> Any:
        answer = self.call(
            "script.evaluate", target={"context": self._page}, awaitPromise=True,
            expression=f"(async () => JSON.stringify((await ({expression})) ?? null))()",
        )  # fmt: skip
        assert answer["type"] == "success", answer
        return json.loads(answer["result"]["value"])

    def set_cookie(self, url: str, name: str, value: str) -> None:
        domain = url.split("//")[1].split(":")[0]
        cookie = {"name": name, "value": {"type": "string", "value": value}, "domain": domain}
        self.call("storage.setCookie", cookie=cookie)

    def dismiss(self) -> bool:
        return "result" in self._ask("browsingContext.handleUserPrompt", context=self._page, accept=False)


# Nothing of this changes what a page hears of mouse, keys and focus.
QUIET = {
    "remote.prefs.recommended": False,
    "browser.shell.checkDefaultBrowser": False,
    "browser.aboutwelcome.enabled": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.enabled": False,
    "app.update.enabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "browser.sessionstore.resume_from_crash": False,
    "signon.rememberSignons": False,
    "dom.successive_dialog_time_limit": 0,  # the protocol knows no dialogs that offer to prevent further ones
}
