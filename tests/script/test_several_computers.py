"""Three web processes and a bridge host behind nginx and Caddy: drive, watch and stop through any, and kill each."""

from __future__ import annotations

import asyncio
import gzip
import http.client
import json
import os
import re
import signal
import subprocess
import time
import urllib.parse
from collections.abc import Iterator
from contextlib import suppress
from http.cookies import SimpleCookie
from typing import Any

import pytest
from websockets.exceptions import WebSocketException

from fleet.server import limits
from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING
from script.stack.client import Driver, open_socket, sign_in, trust
from script.stack.places import REPOSITORY
from tests.processes import free_port, until
from tests.script.computers import (
    BRIDGE_HOST,
    BRIDGES,
    CONSOLE,
    CONSOLE_HOST,
    FAR,
    NEAR,
    PROXIES,
    SECOND,
    THIRD,
    WEBS,
    Computers,
    installed,
    running_computers,
)
from tests.script.support import drive_forward, manage
from tests.script.viewer import viewer

pytestmark = [
    pytest.mark.timeout(400),
    pytest.mark.skipif(not installed(), reason="needs nginx and Caddy: apt install nginx-light caddy"),
]
WEB, SUPERVISOR, BRIDGE = "fleet.server --verbosity", "run_fleet", "run_bridge"
NEWS_S = 15.0
ZERO_S = 2.0  # from the kill of a web process until another one's page shows that the robot stands
LASTS_S = 120.0  # streams through proxies
BACK_S = 60.0  # until a killed process is back, on a busy computer


@pytest.fixture(scope="module")
def computers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Computers]:
    with running_computers(tmp_path_factory.mktemp("computers")) as running:
        yield running


class People:
    """Pages of two people, each opened through a web process of choice."""

    def __init__(self, computers: Computers) -> None:
        self.computers = computers
        self.operator = sign_in(computers, "operator")
        self.supervisor = sign_in(computers, "supervisor")

    def page(self, web: str, robot: str = NEAR, cookie: str = "", tab: str | None = None) -> Driver:
        port = self.computers.port_of(f"front-{web}")
        return Driver(self.computers, robot, cookie or self.operator, port=port, tab=tab)


@pytest.fixture(scope="module")
def people(computers: Computers) -> People:
    return People(computers)


async def test_a_web_process_says_why_it_cannot_reach_a_robot(computers: Computers, people: People) -> None:
    """The robot near the console has no bridge address at first."""
    async with people.page(SECOND, FAR) as page:
        await page.until(lambda: page.gone)
        assert page.gone
        assert page.gone.refusal.text.startswith("No supervisor runs on this computer")
    computers.set_bridge_addresses({FAR: f"wss://{CONSOLE_HOST}:{free_port()}"})
    for web in WEBS:
        async with people.page(web, FAR) as page:
            await page.until(lambda: page.state and page.state.phase == "online", BACK_S)


async def test_people_drive_watch_and_stop_through_any(people: People) -> None:
    async with (
        people.page(CONSOLE) as driver,
        people.page(SECOND, cookie=people.supervisor) as watcher,
        people.page(THIRD, cookie=people.supervisor) as stopper,
    ):
        await driver.take()
        before = await standing_at(watcher)
        await drive_a_little(driver)
        await watcher.until(lambda: watcher.odometry and abs(watcher.odometry.x - before) > 0.05, NEWS_S)
        await stopper.stop()
        for page in (driver, watcher, stopper):
            await page.until(lambda page=page: page.state and page.state.stop.state == "stopped", NEWS_S)
        await stopper.clear()
        await driver.until(lambda: driver.state and driver.state.stop.state == "clear", NEWS_S)
        await driver.release()


def box(driver: Driver) -> Any:
    return driver.state and driver.state.black_box


async def test_a_recording_of_a_bridge_host_is_read_through_any(computers: Computers, people: People) -> None:
    async with people.page(SECOND) as driver:
        await driver.take()
        await driver.until(lambda: box(driver) and box(driver).seconds, BACK_S)
        await driver.stop()
        await driver.until(lambda: box(driver).keeps == "stop", NEWS_S)
        await driver.clear()
        await driver.release()

    def read(path: str, **headers: str) -> bytes:
        connection = http.client.HTTPSConnection(
            "localhost", computers.port_of(f"front-{SECOND}"), timeout=60.0, context=trust(computers)
        )
        connection.request(
            "GET", f"/api/v1/recordings{path}", headers={"Cookie": people.supervisor, **headers}
        )
        return connection.getresponse().read()

    def listed() -> list[dict[str, str]]:
        found: list[dict[str, str]] = json.loads(read(f"?robot={NEAR}"))["recordings"]
        return found

    [recording, *_] = await asyncio.to_thread(until, listed, "the stop is recorded", BACK_S)
    [path] = (computers.directory / BRIDGES / "recordings").glob(f"*-{recording['id']}.mcap")
    file = await asyncio.to_thread(read, f"/{recording['id']}/file", Range="bytes=1000-")
    assert file == path.read_bytes()[1000:]


@pytest.mark.parametrize("robot", [NEAR, FAR])
@pytest.mark.parametrize("killed", WEBS)
async def test_a_web_process_that_dies_ends_no_bridge(
    killed: str, robot: str, computers: Computers, people: People
) -> None:
    other = WEBS[(WEBS.index(killed) + 1) % len(WEBS)]
    bridge = computers.process(BRIDGES if robot == NEAR else CONSOLE, f"{BRIDGE} {robot}")
    async with people.page(other, robot, people.supervisor) as watcher:
        async with people.page(killed, robot) as driver:
            fence = await driver.take()
            await drive_a_little(driver)
            os.kill(computers.process(killed, WEB), signal.SIGKILL)
            killed_s = time.monotonic()
            await watcher.until(lambda: watcher.odometry and abs(watcher.odometry.vx) < 0.01)
            assert time.monotonic() - killed_s < ZERO_S
        async with people.page(other, robot, tab=driver.tab) as resumed:
            await resumed.until(lambda: resumed.fence)
            assert resumed.fence == fence
            await drive_a_little(resumed)
            await resumed.release()
    assert computers.process(BRIDGES if robot == NEAR else CONSOLE, f"{BRIDGE} {robot}") == bridge
    await until_back(people, killed, robot)


async def test_a_supervisor_that_dies_leaves_robots_standing(computers: Computers, people: People) -> None:
    async with people.page(THIRD) as driver:
        await driver.take()
        await drive_a_little(driver)
        os.kill(computers.process(BRIDGES, SUPERVISOR), signal.SIGKILL)
        await driver.until(lambda: driver.gone, NEWS_S)
        driver.view = None  # of the bridge that ended
        await driver.until(lambda: driver.state and driver.state.phase == "online", BACK_S)
        assert driver.odometry and abs(driver.odometry.vx) < 0.01
        await driver.take()
        await drive_a_little(driver)
        await driver.release()


def test_a_second_supervisor_on_another_computer_ends(computers: Computers) -> None:
    first = computers.process(BRIDGES, SUPERVISOR)
    second = subprocess.run(
        ["script/serve", BRIDGES],
        cwd=REPOSITORY,
        env={**computers.environment, **computers.places("copy"), "FLEET_BRIDGE_HOST": BRIDGE_HOST},
        capture_output=True,
        text=True,
        timeout=100.0,
    )
    assert second.returncode == 1
    assert f"runs {BRIDGE_HOST} already" in second.stderr and f"process {first}" in second.stderr
    assert str(EXIT_ALREADY_RUNNING) in second.stderr
    said = manage(computers, "shell", "-c", STATES)
    assert said.endswith(str({NEAR: "running", FAR: "running"}))


STATES = """
from robots.registry.models import BridgeStatus
print(dict(BridgeStatus.objects.order_by("robot__slug").values_list("robot__slug", "state")))
"""


# --- proxies ---------------------------------------------------------------------------------------


class Browser:
    """A browser with cookies, on another computer than the proxy, which may lie about its address."""

    ADDRESS = "127.0.0.9"
    LIES = {"X-Forwarded-For": "192.0.2.6", "X-Forwarded-Proto": "http", "Accept-Encoding": "gzip"}

    def __init__(self, computers: Computers, proxy: str) -> None:
        self._computers = computers
        self._port = computers.port_of("caddy") if proxy == "caddy" else computers.port
        self.cookies: dict[str, str] = {}

    def ask(
        self, path: str, body: bytes | None = None, **headers: str
    ) -> tuple[http.client.HTTPResponse, bytes]:
        connection = http.client.HTTPSConnection(
            "localhost",
            self._port,
            timeout=60.0,
            context=trust(self._computers),
            source_address=(self.ADDRESS, 0),
        )
        cookies = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        sent = self.LIES | {"Cookie": cookies, "Origin": f"https://localhost:{self._port}"} | headers
        try:
            with suppress(OSError):  # the console refuses a body that is too large while it is sent
                connection.request("GET" if body is None else "POST", path, body, sent)
            response = connection.getresponse()
            for line in response.headers.get_all("Set-Cookie", []):
                self.cookies |= {name: found.value for name, found in SimpleCookie(line).items()}
            return response, response.read()
        finally:
            connection.close()

    def sign_in(self) -> None:
        account = self._computers.accounts["operator"]
        page = self.ask("/accounts/sign-in/")[1].decode()
        token = re.findall(r'name="csrfmiddlewaretoken" value="(\w+)"', page)[0]
        form = {"username": account.username, "password": account.password, "csrfmiddlewaretoken": token}
        response, _ = self.ask(
            "/accounts/sign-in/",
            urllib.parse.urlencode(form).encode(),
            **{"Content-Type": "application/x-www-form-urlencoded"},
        )
        assert response.status == 302


@pytest.mark.parametrize("proxy", PROXIES)
def test_a_proxy_passes_what_browser_and_console_say(proxy: str, computers: Computers) -> None:
    browser = Browser(computers, proxy)
    response, page = browser.ask("/accounts/sign-in/", b"x" * (limits.BODY_BYTES + 1))
    assert (response.status, json.loads(page)["figures"]) == (413, {"most_bytes": limits.BODY_BYTES})
    browser.sign_in()
    page = browser.ask("/accounts/sessions/")[1]
    assert Browser.ADDRESS.encode() in page and b"192.0.2.6" not in page
    response, page = browser.ask("/accounts/sessions/", b"x" * (limits.SIGNED_IN_BODY_BYTES + 1))
    assert (response.status, json.loads(page)["figures"]) == (
        413,
        {"most_bytes": limits.SIGNED_IN_BODY_BYTES},
    )
    assert browser.ask("/accounts/sessions/", b"x" * (limits.SIGNED_IN_BODY_BYTES - 1))[0].status != 413
    for path in ("/", f"/robots/{NEAR}/"):
        response, page = browser.ask(path)
        assert response.headers["Content-Encoding"] == "gzip" and gzip.decompress(page)


async def test_streams_through_proxies_last_for_minutes(computers: Computers, people: People) -> None:
    """Longer than the time after which proxies end a silent connection, if nobody tells them otherwise: 60 s."""
    ends_s = time.monotonic() + LASTS_S
    await asyncio.gather(
        *(
            look(computers, people, port, ends_s)
            for port in (computers.port, computers.port_of("caddy"))
            for look in (watch_camera, follow_events, keep_quiet)
        )
    )


async def watch_camera(computers: Computers, people: People, port: int, ends_s: float) -> None:
    async with viewer(computers, people.operator, robot=NEAR, port=port) as watching:
        await watching.watch("head")
        while time.monotonic() < ends_s:
            await watching.gets_pictures(count=20)
        assert watching.closed_s is None


async def follow_events(computers: Computers, people: People, port: int, ends_s: float) -> None:
    """Read an event stream; what the console says comes at once."""
    reader, writer = await asyncio.open_connection(
        "localhost", port, ssl=trust(computers), server_hostname="localhost"
    )
    lines = ("GET /api/v1/events HTTP/1.1", f"Host: localhost:{port}", f"Cookie: {people.operator}")
    writer.write("\r\n".join([*lines, "Accept: text/event-stream", "", ""]).encode())
    began_s = time.monotonic()
    assert b" 200 " in await reader.readline()
    await reader.readuntil(b"retry: 2000")
    assert time.monotonic() - began_s < NEWS_S
    while time.monotonic() < ends_s:
        await asyncio.wait_for(reader.readuntil(b": nothing new"), 60.0)
    writer.close()


async def keep_quiet(computers: Computers, people: People, port: int, ends_s: float) -> None:
    """Open a WebSocket on which nobody says anything."""
    async with open_socket(computers, "/ws/news/", people.operator, port) as socket:
        await socket.recv()
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(socket.recv(), ends_s - time.monotonic())
        await socket.send(json.dumps({"t": "ping", "sent_ms": 1.0}))
        assert json.loads(await socket.recv())["t"] == "pong"


async def until_back(people: People, web: str, robot: str) -> None:
    """Wait until a page through this web process shows that the robot is online."""
    deadline = time.monotonic() + BACK_S
    while True:
        try:
            async with people.page(web, robot) as page:
                await page.until(lambda: page.state and page.state.phase == "online", NEWS_S)
                return
        except (OSError, WebSocketException, TimeoutError):
            if time.monotonic() > deadline:
                raise
        await asyncio.sleep(0.2)


async def standing_at(page: Driver) -> float:
    await page.until(lambda: page.odometry)
    assert page.odometry
    return page.odometry.x


async def drive_a_little(driver: Driver) -> None:
    await driver.until(
        lambda: driver.odometry and driver.state and driver.state.fence == driver.fence, NEWS_S
    )
    await driver.drive(0.0, 0.0)  # the bridge first needs a neutral stick
    await drive_forward(driver)
