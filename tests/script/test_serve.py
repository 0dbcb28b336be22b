"""script/serve, started as for real robots by an administrator; here with a rosmaster and a simulator."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from script.stack.certificates import certificate_for
from script.stack.client import Driver, sign_in
from script.stack.places import REPOSITORY
from script.stack.processes import Child, ReservedPort, end_all
from script.stack.stack import Account, Certificate
from tests.processes import free_port, outside, until
from tests.script.first_run import Form, set_up
from tests.script.support import ENDED_S, Family, drive_forward, listens

READY_S = 120.0
EDIT_S = 3.0  # s, the time in docs/robots.md
ROBOT = "tiago-42"
WEB, BRIDGE = "fleet.server --verbosity", "run_bridge"  # words of command lines
CHECKED = f"/robots/{ROBOT}/check/"
STAFF = Account("first", "staff", "a long walk on the beach")


@pytest.fixture
def settings_of_a_lab(tmp_path: Path) -> dict[str, str]:
    """The minimal settings of docs/deployment.md."""
    return {
        **outside(),
        "FLEET_SECRET_KEY": "a key for one test, which protects nothing at all",
        "FLEET_HOSTS": "127.0.0.1",
        "FLEET_VAR": str(tmp_path / "var"),
        "DJANGO_SETTINGS_MODULE": "script.stack.door.settings",  # not of a lab: the console must not take them
    }


# --- wrong settings -------------------------------------------------------------------------------


def refused(environment: dict[str, str], *words: str) -> str:
    """Run `script/serve`, which must not start; return its output."""
    done = subprocess.run(
        ["script/serve", *words],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        text=True,
        timeout=READY_S,
    )
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "Serving" not in done.stdout
    return done.stderr


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        ("FLEET_SECRET_KEY", "", "FLEET_SECRET_KEY is not set. Make one with: python3 -c"),
        ("FLEET_HOSTS", "", "FLEET_HOSTS is not set. List the names"),
        (
            "FLEET_REDIS_URL",
            "cache.lab.example",
            "FLEET_REDIS_URL is 'cache.lab.example'; it looks like redis://",
        ),
        ("FLEET_TLS", "1", "FLEET_TLS is on, but nothing ends TLS"),
        (
            "FLEET_DATABASE_URL",
            "postgresql://fleet@127.0.0.1:1/fleet",
            "The database cannot be used: connection failed",
        ),
    ],
)
def test_wrong_settings_are_named_before_the_start(
    variable: str, value: str, said: str, settings_of_a_lab: dict[str, str]
) -> None:
    text = refused({**settings_of_a_lab, variable: value}, "--port", str(free_port()))
    assert said in text
    assert not (Path(settings_of_a_lab["FLEET_VAR"]) / "run/fleet.lock").exists()


def test_an_unusable_certificate_is_named_before_the_start(
    tmp_path: Path, settings_of_a_lab: dict[str, str]
) -> None:
    one, other = (certificate_for(["127.0.0.1"], tmp_path / name) for name in ("one", "other"))
    pair = ["--certificate", str(one.certificate), "--private-key", str(other.private_key)]
    assert "set FLEET_TLS=1" in refused(settings_of_a_lab, *pair)
    assert "certificate or its key cannot be used" in refused({**settings_of_a_lab, "FLEET_TLS": "1"}, *pair)


def test_a_port_that_is_taken_is_said_before_anything_starts(settings_of_a_lab: dict[str, str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert f"Cannot listen on 127.0.0.1, port {port}" in refused(settings_of_a_lab, "--port", str(port))


# --- the main job ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Served:
    """A console run by `script/serve`, with an administrator and a browser."""

    environment: dict[str, str]
    log: Path
    port: int = field(default_factory=free_port)
    hosts: tuple[str, ...] = ("127.0.0.1",)
    certificate: Certificate | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def accounts(self) -> dict[str, Account]:
        return {STAFF.role: STAFF}

    def start(self) -> subprocess.Popen[bytes]:
        with self.log.open("ab") as log:
            process = subprocess.Popen(
                ["script/serve", "--port", str(self.port)],
                cwd=REPOSITORY,
                env=self.environment,
                stdout=log,
                stderr=log,
            )
        try:
            until(lambda: listens(self.port) or process.poll() is not None, "somebody listens", READY_S)
            assert process.poll() is None, self.log.read_text()
        except BaseException:
            process.kill()
            raise
        return process

    def submit(self, cookie: str, path: str, **filled: str) -> str:
        """Open a page with a form, fill these fields and save without errors; return the next page's path."""
        fields = Form.of(self.browse(cookie, path)[1]).fields | filled
        leads_to, page = self.browse(cookie, path, urllib.parse.urlencode(fields).encode())
        assert re.findall(r'class="errorlist[^>]*>(.*?)</ul>', page, re.DOTALL) == []
        return leads_to

    def change_of_robot(self, cookie: str) -> str:
        [path] = re.findall(
            r"/admin/robots/robot/[^/]+/change/", self.browse(cookie, "/admin/robots/robot/")[1]
        )
        return str(path)

    def browse(self, cookie: str, path: str, form: bytes | None = None) -> tuple[str, str]:
        headers = {"Cookie": cookie, "Referer": self.url + path}
        request = urllib.request.Request(self.url + path, form, headers)  # noqa: S310
        with urllib.request.urlopen(request, timeout=READY_S) as page:  # noqa: S310 - our own
            return page.url.removeprefix(self.url), page.read().decode()


@pytest.fixture
def master_uri(tmp_path: Path) -> Iterator[str]:
    """The URI of the master of a simulated robot in the middle of the office."""
    port = ReservedPort()
    uri = f"http://127.0.0.1:{port.number}"
    ros = {**outside(), "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": str(tmp_path / "ros")}
    simulator = [sys.executable, "-m", "robots.simulator", "--name", ROBOT, "--pose=2.0,1.8,0"]
    children = [
        Child(
            "master",
            ["/usr/bin/rosmaster", "--core", "-p", str(port.number)],
            env=ros,
            log=tmp_path / "master.log",
        ),
        Child("simulator", simulator, env=ros, log=tmp_path / "simulator.log"),
    ]
    yield uri
    end_all(reversed(children))
    port.close()


@pytest.fixture
def served(tmp_path: Path, settings_of_a_lab: dict[str, str]) -> Iterator[Served]:
    """A console that is not started yet. It ends with the test at the latest."""
    served = Served(settings_of_a_lab, tmp_path / "serve.log")
    yield served
    print(served.log.read_text())


def test_a_robot_is_added_driven_stopped_edited_and_cleaned_up(served: Served, master_uri: str) -> None:
    with running(served) as console:
        cookie = first_run(served, master_uri)
        asyncio.run(drive_stop_edit(served, cookie))
        end_without_a_rest(served, console)


def test_killed_parts_come_back_and_a_stop_outlives_the_console(served: Served, master_uri: str) -> None:
    with running(served) as console:
        cookie = first_run(served, master_uri)
        asyncio.run(drive_stop_edit(served, cookie))
        lose_the_web_process(served, console)
        lose_the_supervisor(served, console)
        end_without_a_rest(served, console)
    with running(served) as console:
        asyncio.run(drive_on(served, cookie))
        end_without_a_rest(served, console)


@contextmanager
def running(served: Served) -> Iterator[subprocess.Popen[bytes]]:
    console = served.start()
    try:
        yield console
    finally:
        console.kill()


def first_run(served: Served, master_uri: str) -> str:
    """Enter the first person and the robot, whose address is this computer's; return the person's cookie."""
    assert "Applying" not in served.log.read_text()  # the address is not behind a line for each migration
    until(lambda: "One-time code: " in served.log.read_text(), "the one-time code", READY_S)
    page = set_up(served.log.read_text(), STAFF, "TIAGo 42", master_uri)
    assert f"The ROS master at {master_uri} answers." in page
    assert "Demo" not in served.browse("", "/accounts/sign-in/")[1]
    cookie = sign_in(served, STAFF.role)
    assert served.submit(cookie, served.change_of_robot(cookie), advertised_address="127.0.0.1") == CHECKED
    return cookie


def end_without_a_rest(served: Served, console: subprocess.Popen[bytes]) -> None:
    family = Family(console.pid)
    console.send_signal(signal.SIGTERM)
    assert console.wait(ENDED_S) == 0
    assert_nothing_left(served, family)


def lose_the_web_process(served: Served, console: subprocess.Popen[bytes]) -> None:
    """Kill the web process: it comes back, and the bridge stays."""
    family = Family(console.pid)
    assert len(family) >= 5  # serve, supervisor, bridge, housekeeping, web process
    os.kill(family.named(WEB), signal.SIGKILL)
    until(
        lambda: "web was ended by SIGKILL; it is started again" in served.log.read_text(), "the log", READY_S
    )
    until(lambda: listens(served.port), "the web process is back", READY_S)
    assert Family(console.pid).named(BRIDGE) == family.named(BRIDGE)


def lose_the_supervisor(served: Served, console: subprocess.Popen[bytes]) -> None:
    """Kill the supervisor: it comes back with its bridges, and the web process stays."""
    family = Family(console.pid)
    os.kill(family.named("run_fleet"), signal.SIGKILL)
    said = "supervisor was ended by SIGKILL; it is started again"
    until(lambda: said in served.log.read_text(), "the log", READY_S)
    until(lambda: BRIDGE in str(Family(console.pid).commands.values()), "a bridge is back", READY_S)
    assert Family(console.pid).named(WEB) == family.named(WEB)


def assert_nothing_left(served: Served, family: Family) -> None:
    family.assert_gone()
    assert not listens(served.port)
    assert not list((Path(served.environment["FLEET_VAR"]) / "run").glob("*.sock"))


async def drive_stop_edit(served: Served, cookie: str) -> None:
    async with Driver(served, ROBOT, cookie) as driver:
        await drive_a_little(driver)
        await driver.stop()
        await driver.until(lambda: driver.state and driver.state.stop.state == "stopped")

        await asyncio.to_thread(served.submit, cookie, served.change_of_robot(cookie), max_share="0.5")
        saved_s = time.monotonic()
        await driver.until(lambda: driver.robot and driver.robot.max_share == 0.5)
        assert time.monotonic() - saved_s < EDIT_S
        await driver.until(lambda: driver.state and driver.state.phase == "online")
        assert driver.state and driver.state.stop.state == "stopped"  # also the new bridge is latched


async def drive_on(served: Served, cookie: str) -> None:
    """Check that after the restart the person is signed in and the robot stopped; clear the stop and drive."""
    async with Driver(served, ROBOT, cookie) as driver:
        await driver.until(lambda: driver.state and driver.state.phase == "online")
        assert driver.state and driver.state.stop.state == "stopped"
        await driver.take()
        await driver.clear()
        await drive_a_little(driver)


async def drive_a_little(driver: Driver) -> None:
    await driver.until(lambda: driver.state and driver.state.phase == "online" and driver.odometry)
    if driver.fence is None:
        await driver.take()
    await drive_forward(driver)
