"""Every way to press the emergency stop, one after the other."""

from __future__ import annotations

import asyncio
import http.client
import subprocess
import sys
import time
import urllib.parse
from collections import Counter
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, WebSocketException

from benchmarks.driving.stop import ROBOT
from robots.shared import wire
from script.stack.client import Driver, open_socket
from script.stack.stack import Stack

PAGES = ("page", "fleet page")  # a press gets no answer here: the page shows the robot's state
NAMES = (*PAGES, "REST", "form", "token")  # in turn
COMMAND_LINE = "command line"  # each tenth press
EVERY = 10
ANSWER_S = 20.0
FAULTS = (OSError, ConnectionClosed, WebSocketException, asyncio.TimeoutError, http.client.HTTPException)


def door(number: int) -> str:
    """Return the door of press `number`."""
    return COMMAND_LINE if number % EVERY == EVERY - 1 else NAMES[number % len(NAMES)]


class Doors:
    """Async context: opens all doors except the driver's page before the first press.

    The command line is manage.py stop in a process that has already loaded Django: Python's start is not measured.
    """

    def __init__(self, stack: Stack, cookie: str, token: str) -> None:
        self.driver: Driver | None = None
        self.answers: Counter[str] = Counter()
        self.answered_s: list[float] = []  # of the doors that answer
        self._stack, self._cookie, self._token = stack, cookie, token
        self._fleet: ClientConnection | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._opening: asyncio.Task[None] | None = None
        self._opened = asyncio.Event()  # the fleet page, for the first time

    async def __aenter__(self) -> Doors:
        self._command_line = await asyncio.create_subprocess_exec(
            *("/usr/bin/setpriv", "--pdeathsig", "TERM"),
            *(sys.executable, "-m", "benchmarks.attacks.command_line_side"),
            env=self._stack.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        await asyncio.wait_for(self._line(), ANSWER_S)
        self._opening = asyncio.ensure_future(self._keep_fleet_page())
        await asyncio.wait_for(self._opened.wait(), ANSWER_S)
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in [*self._tasks, *([self._opening] if self._opening else [])]:
            task.cancel()
        if self._fleet is not None:
            await self._fleet.close()
        if self._command_line.returncode is None:
            self._command_line.terminate()
        await self._command_line.wait()

    def press(self, name: str) -> float:
        """Press at this door and return the time; a task counts the answer later."""
        csrf = next((value for key, _, value in self._cookies() if key.startswith("fleet_csrf")), "")
        pressed_s = time.monotonic()
        match name:
            case "page":
                self._begin(name, self._page())
            case "fleet page":
                self._begin(name, self._fleet_page())
            case "REST":
                path, headers = f"/api/robots/{ROBOT}/stop/", {"X-CSRFToken": csrf}
                self._begin(name, asyncio.to_thread(self._post, path, headers, ""))
            case "token":
                self._begin(name, asyncio.to_thread(self._post_with_token))
            case "form":
                fields = urllib.parse.urlencode({"csrfmiddlewaretoken": csrf})
                headers = {"Content-Type": "application/x-www-form-urlencoded"}
                self._begin(name, asyncio.to_thread(self._post, f"/robots/{ROBOT}/stop/", headers, fields))
            case _:
                self._begin(name, self._command())
        return pressed_s

    def _cookies(self) -> list[tuple[str, str, str]]:
        return [cookie.strip().partition("=") for cookie in self._cookie.split(";")]

    def _begin(self, name: str, pressing: Coroutine[Any, Any, str]) -> None:
        async def count() -> None:
            pressed_s = time.monotonic()
            try:
                answer = await pressing
                if name not in PAGES:
                    self.answered_s.append(time.monotonic() - pressed_s)
            except FAULTS as error:
                answer = type(error).__name__
            self.answers[f"{name}: {answer}"] += 1

        task = asyncio.ensure_future(count())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _page(self) -> str:
        if self.driver is None or self.driver.closed:
            return "no page"
        await self.driver.stop()
        return "sent"

    async def _fleet_page(self) -> str:
        if self._fleet is None:
            return "no page"
        await self._fleet.send(wire.encode(wire.StopRobot(ROBOT)), text=True)
        return "sent"

    def _post(self, path: str, headers: dict[str, str], body: str) -> str:
        """Send a POST request as a page does. Returns the status."""
        page = {"Cookie": self._cookie, "Origin": self._stack.url, "Referer": f"{self._stack.url}/"}
        return self._send(path, {**page, **headers}, body)

    def _post_with_token(self) -> str:
        headers = {"Authorization": f"Bearer {self._token}"}
        return self._send(f"/api/v1/robots/{ROBOT}/stop", headers, "")

    def _send(self, path: str, headers: dict[str, str], body: str) -> str:
        """Send a POST request; blocks, so it runs on a thread. Returns the status."""
        connection = http.client.HTTPConnection(self._stack.hosts[0], self._stack.port, timeout=ANSWER_S)
        try:
            connection.request("POST", path, body, headers)
            answer = connection.getresponse()
            answer.read()
            return str(answer.status)
        finally:
            connection.close()

    async def _command(self) -> str:
        assert self._command_line.stdin is not None  # noqa: S101 - we asked for a pipe
        self._command_line.stdin.write(b"stop\n")
        return await asyncio.wait_for(self._line(), ANSWER_S)

    async def _line(self) -> str:
        assert self._command_line.stdout is not None  # noqa: S101 - we asked for a pipe
        return (await self._command_line.stdout.readline()).decode().strip()

    async def _keep_fleet_page(self) -> None:
        """Keep the fleet page's WebSocket open: connect again when it closes, as the page's script does."""
        while True:
            with suppress(*FAULTS):
                async with open_socket(self._stack, "/ws/fleet/", self._cookie) as socket:
                    self._fleet = socket
                    self._opened.set()
                    async for _ in socket:
                        await socket.send(wire.encode(wire.Ack()), text=True)
            self._fleet = None
            await asyncio.sleep(0.5)
