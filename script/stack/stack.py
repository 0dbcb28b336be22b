"""All processes on one computer: ROS masters and simulated robots, fleet supervisor and bridges, web process.

    with Stack(directory) as stack:
        stack.url, stack.accounts["operator"].password, stack.robots["tiago-1"].master_uri

All processes that a stack starts end with it, also if it is killed. All files that it writes are in its directory.
"""

from __future__ import annotations

import http.client
import json
import os
import secrets
import shutil
import socket
import ssl
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
from websockets.exceptions import WebSocketException
from websockets.sync.client import unix_connect

from robots.shared import wire
from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from script.stack.database import with_tables
from script.stack.places import (
    COLLECTED,
    Stamp,
    kept_secret,
    locked,
    migration_sources,
    private_file,
    static_sources,
)
from script.stack.processes import Child, ChildDied, ReservedDomain, ReservedPort, end_all

ROLES = ("observer", "operator", "supervisor", "staff")
READY_S = 120.0  # limit for a slow and busy computer; usually it takes 10 s
LONGEST_SOCKET_PATH = 107  # sun_path has 108 bytes, with the zero at its end
SOCKET_NAME_LENGTH = len("/123456789012.sock")


class StartError(RuntimeError):
    """The stack could not be started; the text is the reason."""


@dataclass(frozen=True)
class PracticeRobot:
    """A simulated robot: its name in the registry and its pose (metres, degrees).

    Robot and console advertise `address` and `console_address` to each other. If the robot has its own network,
    `inside` is a prefix that runs a command in it. `options` are further options of the robot's simulator. A robot of
    ROS 2 has a domain on this computer instead of a master and addresses.
    """

    slug: str
    name: str
    pose: tuple[float, float, float]
    address: str = "127.0.0.1"
    console_address: str = "127.0.0.1"
    inside: tuple[str, ...] = ()
    # (): no input filters between stick and gate; None: the profile's filters
    stick: tuple[()] | None = None
    rear_camera: bool = False
    camera: bool = True  # pages show the head camera; without it a page takes a third of the computing time
    is_on: bool = True  # False: the console knows the robot, which is off until `SimulatedRobot.switch_on()`
    options: tuple[str, ...] = ()
    ros: int = 1


@dataclass(frozen=True)
class Account:
    """A person who can sign in."""

    username: str
    role: str
    password: str


@dataclass(frozen=True)
class Certificate:
    """Files for TLS: the server's certificate and key, and the authority that signed it."""

    certificate: Path
    private_key: Path
    authority: Path | None


PRACTICE_ROBOTS = (
    PracticeRobot("tiago-1", "TIAGo One", (2.0, 1.8, 0.0)),
    PracticeRobot("tiago-2", "TIAGo Two", (3.8, 2.4, 0.0), rear_camera=True),
    PracticeRobot("tiago-3", "TIAGo Three", (7.4, 4.9, 180.0)),
)
MIXED_ROBOTS = (*PRACTICE_ROBOTS[:2], replace(PRACTICE_ROBOTS[2], ros=2))


class SimulatedRobot:
    """A simulator of this stack, and with ROS 1 its rosmaster."""

    def __init__(self, plan: PracticeRobot, stack: Stack) -> None:
        self.plan = plan
        self.port = ReservedPort()
        self.domain = ReservedDomain() if plan.ros == 2 else None
        self.link_path = ""  # the bridge's socket, from the registry
        self._stack = stack
        if plan.is_on:
            self.switch_on()

    @property
    def master_uri(self) -> str:
        return f"http://{self.plan.address}:{self.port.number}"

    @property
    def environment(self) -> dict[str, str]:
        """Return the environment of ROS programs of this robot."""
        inherited = {**self._stack.environment, "ROS_LOG_DIR": str(self._stack.logs / self.plan.slug)}
        if self.domain is not None:
            domain = domain_environment(self.domain.number, self.discovery)
            return inherited | ros_environment([MESSAGES, WHEELS]) | domain
        return {**inherited, "ROS_MASTER_URI": self.master_uri, "ROS_IP": self.plan.address}

    @property
    def discovery(self) -> str:
        """Return where a robot of ROS 2 and its console look for each other."""
        return "subnet" if self.plan.inside else "localhost"

    @property
    def reached(self) -> dict[str, str | int]:
        """Return the fields of the registry by which it is reached."""
        if self.domain is not None:
            return {"domain_id": self.domain.number, "discovery": self.discovery}
        return {"master_uri": self.master_uri, "advertised_address": self.plan.console_address}

    def close(self) -> None:
        """Give port and domain back."""
        self.port.close()
        if self.domain is not None:
            self.domain.close()

    def switch_on(self) -> None:
        """Start the robot's processes."""
        if self.domain is None:
            self.start_master()
        self.start_simulator()

    def switch_off(self) -> None:
        """End the robot's processes."""
        self._stack.release(self.simulator)
        if self.domain is None:
            self._stack.release(self.master)

    def start_master(self) -> Child:
        self.master = self._stack.start_child(
            f"{self.plan.slug}-master",
            [*self.plan.inside, "/usr/bin/rosmaster", "--core", "-p", str(self.port.number)],
            self.environment,
        )
        return self.master

    def start_simulator(self) -> Child:
        pose = ",".join(f"{value:g}" for value in self.plan.pose)
        self.simulator = self._stack.start_child(
            f"{self.plan.slug}-simulator",
            [
                *self.plan.inside,
                *(sys.executable, "-m", "robots.simulator", "--world", "office", "--name", self.plan.slug),
                *("--ros", str(self.plan.ros)),
                *(f"--pose={pose}", "--seed", str(self.plan.slug.encode()[-1])),
                *(("--rear-camera",) if self.plan.rear_camera else ()),
                *self.plan.options,
            ],
            self.environment,
        )
        return self.simulator


class Stack:
    """A running console; see the module. `directory` is created if it does not exist, and used again if it exists."""

    def __init__(
        self,
        directory: Path,
        *,
        robots: Sequence[PracticeRobot] = PRACTICE_ROBOTS,
        listener: socket.socket | None = None,
        certificate: Certificate | None = None,
        hosts: Sequence[str] = ("127.0.0.1", "localhost"),
        settings: Mapping[str, str] | None = None,
        students: Sequence[str] = (),
    ) -> None:
        self.directory = directory.absolute()
        self.plans = robots
        self.listener = listener or socket.create_server(("127.0.0.1", 0))
        self.bind: str = self.listener.getsockname()[0]
        self.port: int = self.listener.getsockname()[1]
        self.certificate = certificate
        self.hosts = hosts
        self._settings = settings or {}  # further settings, FLEET_...
        self._student_names = students  # of a course with bookings
        self.robots: dict[str, SimulatedRobot] = {}
        self.children: list[Child] = []
        self._closing = ExitStack()
        self._closing.callback(self.listener.close)

    def __enter__(self) -> Stack:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end_processes()

    @property
    def url(self) -> str:
        """Return the console's address for a browser on this computer, without a slash at the end."""
        return f"{'https' if self.certificate else 'http'}://{self.hosts[0]}:{self.port}"

    # --- start -----------------------------------------------------------------------------------

    def start(self, timeout_s: float = READY_S) -> None:
        """Start everything, and wait until people can sign in and every robot that is on is online."""
        self.launch()
        try:
            self.wait_ready(timeout_s)
        except BaseException:
            self.end_processes()
            raise

    def launch(self) -> None:
        """Start everything, without waiting for the robots."""
        try:
            self._prepare()
            self._start_robots()
            self._make_database()
            self.start_supervisor()
            self.start_web()
        except BaseException:
            self.end_processes()
            raise

    def _prepare(self) -> None:
        self.directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.directory.chmod(0o700)  # also if the directory exists: its database contains session keys
        self.logs = self.directory / "log"
        shutil.rmtree(self.logs, ignore_errors=True)
        self.logs.mkdir()
        self.run_directory = self._short_enough(self.directory / "run")
        self.run_directory.mkdir(mode=0o700, exist_ok=True)
        self.accounts = self._load_accounts()
        self.environment = self._environment()

    def _short_enough(self, directory: Path) -> Path:
        """Return `directory`, or a temporary directory if the path of a socket in it would be too long."""
        if len(os.fsencode(directory)) + SOCKET_NAME_LENGTH <= LONGEST_SOCKET_PATH:
            return directory
        return Path(self._closing.enter_context(tempfile.TemporaryDirectory(prefix="fleet-")))

    def _load_accounts(self) -> dict[str, Account]:
        path = self.directory / "passwords.txt"
        names = (*ROLES, *self._student_names)
        passwords = dict(line.split() for line in path.read_text().splitlines()) if path.exists() else {}
        if not passwords.keys() >= set(names):
            passwords = {name: secrets.token_urlsafe(9) for name in names} | passwords
            private_file(path, "".join(f"{name} {password}\n" for name, password in passwords.items()))
        self.students = [Account(name, "student", passwords[name]) for name in self._student_names]
        return {role: Account(role, role, passwords[role]) for role in ROLES}

    def _environment(self) -> dict[str, str]:
        foreign = ("FLEET_", "ROS_", "DJANGO_")
        kept = {name: value for name, value in os.environ.items() if not name.startswith(foreign)}
        scheme = "https" if self.certificate else "http"
        return {
            **kept,
            "PYTHONUNBUFFERED": "1",
            "FLEET_VAR": str(self.directory),
            "FLEET_RUN_DIR": str(self.run_directory),
            "FLEET_SECRET_KEY": kept_secret(self.directory / "secret-key"),
            "FLEET_HOSTS": ",".join(self.hosts),
            "FLEET_ORIGINS": ",".join(f"{scheme}://{host}:{self.port}" for host in self.hosts),
            "FLEET_TLS": "1" if self.certificate else "0",
            "ROS_LOG_DIR": str(self.logs),
            "ROS_HOME": str(self.directory / "ros"),
            **self._settings,
        }

    def start_child(
        self, name: str, command: Sequence[str], environment: dict[str, str], fds: Sequence[int] = ()
    ) -> Child:
        """Start a process that ends with the stack."""
        child = Child(name, command, env=environment, log=self.logs / f"{name}.log", fds=fds)
        self.children = [other for other in self.children if other.name != name] + [child]
        return child

    def release(self, *children: Child) -> None:
        """End these processes."""
        end_all(children)
        self.children = [child for child in self.children if child not in children]

    def manage(self, name: str, *arguments: str) -> Child:
        """Start a command of manage.py."""
        return self.start_child(name, [sys.executable, "manage.py", *arguments], self.environment)

    def _start_robots(self) -> None:
        if any(plan.ros == 2 for plan in self.plans) and not (MESSAGES / "ready").exists():
            raise StartError("A robot of ROS 2 needs rclpy, which script/setup ros2 has not installed.")
        for plan in self.plans:
            robot = SimulatedRobot(plan, self)
            self._closing.callback(robot.close)
            self.robots[plan.slug] = robot

    def _make_database(self) -> None:
        migrated = Stamp(self.directory / "migrated", migration_sources())
        command = None
        if not migrated.fits:
            command = self.manage("migrate", "migrate", "--no-input", "--verbosity", "0")
        self._collect_static()
        if command is not None:
            self._finish(command)
            migrated.set()
        self._seed()

    def _collect_static(self) -> None:
        """Copy the collected static files. All stacks share one result, because it takes 2 s of processor time."""
        collected = Stamp(self.directory / "collected", static_sources())
        if collected.fits:
            return
        with locked(COLLECTED / "lock"):
            built = Stamp(COLLECTED / "collected", static_sources())
            if not built.fits:
                built.unset()
                shutil.rmtree(COLLECTED / "static", ignore_errors=True)
                environment = {**self.environment, "FLEET_VAR": str(COLLECTED)}
                words = ["collectstatic", "--no-input", "--verbosity", "0"]
                self._finish(self.start_child(words[0], [sys.executable, "manage.py", *words], environment))
                built.set()
            shutil.copytree(COLLECTED / "static", self.directory / "static", dirs_exist_ok=True)
        collected.set()

    def _seed(self) -> None:
        plan = self.directory / "seed.json"
        plan.unlink(missing_ok=True)
        robots = [
            {
                "slug": robot.plan.slug,
                "name": robot.plan.name,
                **robot.reached,
                "stick": robot.plan.stick,
                "rear_camera": robot.plan.rear_camera,
                "camera": robot.plan.camera,
            }
            for robot in self.robots.values()
        ]
        accounts = [
            {"username": account.username, "role": account.role, "password": account.password}
            for account in self.accounts.values()
        ]
        students = [{"username": one.username, "password": one.password} for one in self.students]
        private_file(plan, json.dumps({"robots": robots, "accounts": accounts, "students": students}))
        command = self.manage("seed", "seed_demo", str(plan))
        self._finish(command)
        plan.unlink()
        links: dict[str, str] = json.loads(command.last_lines().splitlines()[-1])
        for slug, path in links.items():
            self.robots[slug].link_path = path

    def _finish(self, command: Child) -> None:
        """Wait for the end of a command; raise `StartError` if it fails."""
        if not command.wait(120.0) or command.process.returncode:
            raise StartError(str(ChildDied(command)))
        self.children.remove(command)

    def start_supervisor(self) -> Child:
        self.supervisor = self.manage("supervisor", "run_fleet")
        return self.supervisor

    def start_web(self) -> Child:
        """Start the web process with an open socket, so that nobody else takes the port and early requests wait."""
        if self.certificate is None:
            fds = [self.listener.fileno()]
            endpoint = ["--fd", str(fds[0])]
        else:  # Daphne takes an open socket for plain http only
            self.listener.close()
            fds = []
            endpoint = ["--endpoint", tls_endpoint(self.certificate, self.bind, self.port)]
        self.web = self.start_child("web", [*daphne(), *endpoint], self.environment, fds)
        return self.web

    # --- ready -----------------------------------------------------------------------------------

    def wait_ready(self, timeout_s: float = READY_S) -> None:
        """Wait until people can sign in and every robot that is on is online."""
        deadline = time.monotonic() + timeout_s
        self.wait_web(deadline)
        for slug, robot in self.robots.items():
            if robot.plan.is_on:
                self.wait_online(slug, deadline)

    def _tries(self, deadline: float, what: str) -> Iterator[None]:
        """Repeat a check until `deadline`; raise `ChildDied` if a process ends, `StartError` at the deadline."""
        while time.monotonic() < deadline:
            self.check()
            yield
            time.sleep(0.02)
        raise StartError(f"{what} was not ready in time; logs are in {self.logs}.")

    def check(self) -> None:
        """Raise `ChildDied` if a process ended."""
        for child in self.children:
            if not child.running:
                raise ChildDied(child)

    def wait_web(self, deadline: float) -> None:
        """Wait until the web process answers."""
        for _ in self._tries(deadline, "The web process"):
            try:
                connection = self._connection()
                connection.request("GET", "/healthz")
                if connection.getresponse().status == http.HTTPStatus.OK:
                    return
            except OSError:
                continue

    def _connection(self) -> http.client.HTTPConnection:
        host = self.hosts[0]
        if self.certificate is None:
            return http.client.HTTPConnection(host, self.port, timeout=5.0)
        trust = ssl.create_default_context(cafile=str(self.certificate.authority))
        return http.client.HTTPSConnection(host, self.port, timeout=5.0, context=trust)

    def wait_online(self, slug: str, deadline: float) -> None:
        """Wait until the robot's bridge reports the robot online."""
        path = self.robots[slug].link_path
        for _ in self._tries(deadline, f"The bridge of {slug}"):
            try:
                if self._reports_online(path, deadline):
                    return
            except (OSError, WebSocketException):
                continue

    def _reports_online(self, path: str, deadline: float) -> bool:
        with unix_connect(path, "ws://bridge/", compression=None, open_timeout=2.0) as link:
            link.send(wire.encode(wire.LinkHello(wire.PROTOCOL, "start")).decode())
            while time.monotonic() < deadline:
                self.check()
                try:
                    report = wire.link_report(link.recv(timeout=0.5))
                except (TimeoutError, msgspec.DecodeError):
                    continue
                if isinstance(report, wire.Status) and report.state.phase == "online":
                    return True
        return False

    # --- end -------------------------------------------------------------------------------------

    def end_processes(self) -> None:
        """End every process; the ROS masters last, because all nodes unregister from them."""
        masters = {f"{slug}-master" for slug in self.robots}
        end_all(child for child in self.children if child.name not in masters)
        end_all(child for child in self.children if child.name in masters)
        self.children.clear()
        for left_over in self.run_directory.glob("*.sock"):
            left_over.unlink(missing_ok=True)  # pages processes that end late remove their own sockets
        self._closing.close()


@contextmanager
def temporary_stack(
    robots: Sequence[PracticeRobot] = PRACTICE_ROBOTS,
    *,
    settings: Mapping[str, str] | None = None,
    students: Sequence[str] = (),
) -> Iterator[Stack]:
    """Context: a stack on free ports, in a temporary directory, which is kept after a failure.

    It keeps no recordings unless the settings name a folder: a recorder for each control would cost much.
    """
    settings = {"FLEET_RECORDINGS": "off", **(settings or {})}
    directory = Path(tempfile.mkdtemp(prefix="fleet-"))
    try:
        if "FLEET_DATABASE_URL" not in settings:
            with_tables(directory)
        with Stack(directory, robots=robots, settings=settings, students=students) as stack:
            yield stack
    except BaseException:
        print(f"Logs of the failed run are kept in {directory / 'log'}.", file=sys.stderr)
        raise
    shutil.rmtree(directory)


def daphne() -> list[str]:
    """Return the command of the web process, without its addresses."""
    return [sys.executable, "-m", "fleet.server", "--verbosity", "0", "fleet.site.asgi:application"]


def tls_endpoint(certificate: Certificate, address: str, port: int) -> str:
    """Return the description of a TLS endpoint for Twisted."""
    files = {"privateKey": certificate.private_key, "certKey": certificate.certificate}
    if certificate.authority:
        files["extraCertChain"] = certificate.authority
    escaped = [f"{key}={_escape(str(path))}" for key, path in files.items()]
    return ":".join(["ssl", str(port), f"interface={address}", *escaped])


def _escape(value: str) -> str:
    """Escape ``:``, the separator of endpoint descriptions."""
    return value.replace("\\", r"\\").replace(":", r"\:")
