"""script/demo, started and ended as a person does it."""

from __future__ import annotations

import asyncio
import http.client
import os
import re
import shutil
import signal
import subprocess
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from script.stack.certificates import lan_addresses
from script.stack.client import Driver, sign_in, trust
from script.stack.demo import qr_code
from script.stack.places import REPOSITORY
from script.stack.stack import Account, Certificate
from tests.browser.conftest import ARGUMENTS, CHROMIUM
from tests.browser.people import Person
from tests.processes import free_port, outside, until
from tests.ros2.side import needs_rclpy
from tests.script.support import ENDED_S, Family, listens

PATIENCE_S = 120.0


class Demo:
    """A running demo on a free port."""

    def __init__(self, output: Path, port: int, *flags: str) -> None:
        self.port = port
        self.directory = REPOSITORY / "var" / f"demo-{port}"
        self._output = output
        with output.open("w") as file:
            self.process = subprocess.Popen(
                ["script/demo", "--port", str(port), *flags],
                cwd=REPOSITORY,
                stdout=file,
                stderr=file,
                env=outside(),
            )
        try:
            until(
                lambda: "is ready" in self.said or self.process.poll() is not None,
                "the demo is ready",
                PATIENCE_S,
            )
            assert self.process.poll() is None, self.said
        except BaseException:
            self.end()
            raise
        self.family = Family(self.process.pid)

    def end(self) -> None:
        """End the demo if it still runs."""
        self.process.terminate()
        self.process.wait()

    @property
    def said(self) -> str:
        return self._output.read_text()

    def assert_nothing_left(self) -> None:
        """Check that no process, port or socket file is left."""
        self.family.assert_gone()
        assert not listens(self.port)
        assert not list((self.directory / "run").glob("*.sock"))


Start = Callable[..., Demo]


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """The port of all demos of these tests. They share a folder: only the first demo creates a database."""
    number = free_port()
    yield number
    shutil.rmtree(REPOSITORY / "var" / f"demo-{number}")


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """`start(port)`: start a demo on a port. It ends with the test at the latest."""
    started: list[Demo] = []

    def start(port: int, *flags: str) -> Demo:
        started.append(Demo(tmp_path / f"output-{len(started)}", port, *flags))
        return started[-1]

    yield start
    for demo in started:
        demo.end()


@pytest.mark.parametrize("which", [[], pytest.param(["--mixed"], marks=needs_rclpy)], ids=["plain", "mixed"])
def test_the_main_job_works_from_the_command_line(which):
    """With `--mixed` the robot with ROS 2 drives, beside two with ROS 1."""
    command = ["script/demo", *which, "--smoke"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert re.search(r"smoke: ready in .* m driven in .* stop pressed, standstill after \d+ ms", done.stdout)


def test_ctrl_c_ends_all_processes_and_keeps_passwords(port: int, start: Start):
    first = start(port)
    passwords = first.directory / "passwords.txt"
    assert passwords.stat().st_mode & 0o777 == 0o600
    kept = passwords.read_text()
    first.process.send_signal(signal.SIGINT)
    assert first.process.wait(ENDED_S) == 0
    first.assert_nothing_left()

    second = start(port)
    assert passwords.read_text() == kept
    assert all(line.split()[1] in second.said for line in kept.splitlines())
    assert_one_press_signs_in(second)
    assert_the_port_is_refused_to_another(second)
    assert len(second.family) > 10  # three masters, three simulators, three bridges, supervisor, web process
    second.process.kill()
    second.process.wait()
    second.assert_nothing_left()


def assert_one_press_signs_in(demo: Demo) -> None:
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    address = f"http://127.0.0.1:{demo.port}/accounts/sign-in/"
    with browser.open(address, timeout=PATIENCE_S) as page:
        [token, *_] = re.findall(r'name="csrfmiddlewaretoken" value="([^"]+)"', page.read().decode())
    pressed = urllib.parse.urlencode({"name": "supervisor", "csrfmiddlewaretoken": token}).encode()
    request = urllib.request.Request(f"{address}demo/", pressed, {"Referer": address})  # noqa: S310 - our own
    with browser.open(request, timeout=PATIENCE_S) as page:
        assert "Menu of Supervisor" in page.read().decode()


def assert_the_port_is_refused_to_another(demo: Demo) -> None:
    other = subprocess.run(
        ["script/demo", "--port", str(demo.port)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=ENDED_S,
    )
    assert other.returncode == 1
    assert f"Cannot listen on port {demo.port}" in other.stderr
    assert listens(demo.port)


# --- on the lab's network -------------------------------------------------------------------------


@dataclass(frozen=True)
class OnTheNetwork:
    """A demo that other computers can reach."""

    demo: Demo
    hosts: tuple[str, ...]

    @property
    def port(self) -> int:
        return self.demo.port

    @property
    def url(self) -> str:
        return f"https://{self.hosts[0]}:{self.port}"

    @property
    def certificate(self) -> Certificate:
        tls = self.demo.directory / "tls"
        return Certificate(tls / "server.crt", tls / "server.key", tls / "authority.crt")

    @property
    def accounts(self) -> dict[str, Account]:
        lines = (self.demo.directory / "passwords.txt").read_text().splitlines()
        return {role: Account(role, role, password) for role, password in map(str.split, lines)}

    def get(self, path: str, host: str | None = None) -> http.client.HTTPResponse:
        """Get a page over TLS. Trust only the demo's certificate authority, and check the address."""
        connection = http.client.HTTPSConnection(
            self.hosts[0], self.port, timeout=PATIENCE_S, context=trust(self)
        )
        connection.request("GET", path, headers={"Host": host or f"{self.hosts[0]}:{self.port}"})
        return connection.getresponse()


def test_phones_drive_over_tls_until_a_dead_part_ends_the_demo(port: int, start: Start):
    addresses = lan_addresses()
    demo = start(port, *(["--lan"] if addresses else []))
    if addresses:
        drive_by_phone(demo, addresses[0])
    os.kill(demo.family.named("fleet.server --verbosity"), signal.SIGKILL)
    assert demo.process.wait(ENDED_S) == 1
    assert "web was ended by SIGKILL" in demo.said
    demo.assert_nothing_left()
    if not addresses:
        pytest.skip("nothing was driven over TLS: this machine has no address in any network")


def drive_by_phone(demo: Demo, address: str) -> None:
    """Check the address, the certificate and its pages, and drive in a browser."""
    console = OnTheNetwork(demo, (address,))
    assert f"{console.url}/" in demo.said
    picture = qr_code(f"{console.url}/")
    until(lambda: picture in demo.said, "the picture of the address")  # printed after the line "is ready"

    page = console.get("/accounts/sign-in/")
    assert page.status == 200
    assert "Demo" not in page.read().decode()  # everybody on the network would come in
    assert page.headers["Set-Cookie"].endswith("; Secure")
    assert console.get("/accounts/sign-in/", host="fleet.example").status == 400

    asyncio.run(drive_over_tls(console))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        operator = Person(console, browser, "operator")
        operator.sign_in()
        assert all(cookie["secure"] for cookie in operator.context.cookies())
        operator.take("tiago-3")  # the first robot is stopped, the second is in a student’s slot
        assert operator.page.evaluate("isSecureContext")
        operator.drive("w", metres=0.1)
        operator.let_go("w")
        operator.release()
        assert operator.complaints == []
        browser.close()


async def drive_over_tls(console: OnTheNetwork) -> None:
    cookie = await asyncio.to_thread(sign_in, console, "operator")
    for stranger in (f"http://{console.hosts[0]}:{console.port}", "https://fleet.example"):
        headers = {"Cookie": cookie}
        address = f"wss://{console.hosts[0]}:{console.port}/ws/robots/tiago-1/"
        with pytest.raises(InvalidStatus, match="403"):
            await connect(address, origin=Origin(stranger), additional_headers=headers, ssl=trust(console))
    async with Driver(console, "tiago-1", cookie) as driver:
        await driver.until(lambda: driver.odometry)
        await driver.take()
        began_at = driver.odometry
        assert began_at
        await driver.hold_stick(1.0, 0.0, lambda: driver.odometry and driver.odometry.x - began_at.x > 0.1)
        await driver.stop()
        await driver.until(lambda: driver.state and driver.state.stop.state == "stopped")
