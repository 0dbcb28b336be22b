"""A console on four computers, by the commands of docs/several-computers.md: three web processes and a bridge host.

All run here, each with its own folders and addresses. They share PostgreSQL and Redis; nginx and Caddy are before them,
with the files in deploy/.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from script.stack.certificates import certificate_for
from script.stack.places import REPOSITORY
from script.stack.processes import Child, ReservedPort
from script.stack.stack import PRACTICE_ROBOTS, Stack
from tests.processes import until
from tests.script.servers import Redis, postgresql
from tests.script.support import Family, listens

READY_S = 120.0
PROXIES = ("nginx", "caddy")
CONSOLE, SECOND, THIRD = "console", "second", "third"
WEBS = (CONSOLE, SECOND, THIRD)
BRIDGES = "bridges"
CONSOLE_HOST, BRIDGE_HOST = "127.0.0.3", "127.0.0.2"  # the computers' names in bridge addresses
NEAR, FAR = (robot.slug for robot in PRACTICE_ROBOTS[:2])  # near the bridge host; near the console
ADDRESSES = """
from robots.registry.models import Robot
from robots.registry.services import robot_save
for slug, address in {}.items():
    robot = Robot.objects.get(slug=slug)
    robot.bridge_address = address
    robot_save(robot=robot, actor=None)
"""


def installed() -> bool:
    """Return whether nginx and Caddy are installed."""
    return all(map(shutil.which, PROXIES))


class Computers(Stack):
    """The running computers. Its address is that of nginx before all three web processes."""

    def __init__(self, directory: Path, servers: Mapping[str, str]) -> None:
        directory.mkdir(mode=0o700)
        certificate = certificate_for(["localhost"], directory / "tls")
        super().__init__(
            directory,
            robots=PRACTICE_ROBOTS[:2],
            certificate=certificate,
            hosts=("localhost",),
            settings={
                **servers,
                "FLEET_LINK_SECRET": "s" * 40,
            },
        )
        self._ports = {name: ReservedPort() for name in (*WEBS, *(f"front-{web}" for web in WEBS), "caddy")}
        self._sockets = Path(tempfile.mkdtemp(prefix="fleet-"))
        self._closing.callback(shutil.rmtree, self._sockets)
        for port in self._ports.values():
            self._closing.callback(port.close)

    def launch(self) -> None:
        """Start the console, which makes the database; then the others."""
        try:
            self._prepare()
            self._start_robots()
            self.serve(CONSOLE, FLEET_BRIDGE_HOST=CONSOLE_HOST)
            self._seed()
            self.bridge_port = ReservedPort(BRIDGE_HOST)
            self._closing.callback(self.bridge_port.close)
            self.set_bridge_addresses({NEAR: f"wss://{BRIDGE_HOST}:{self.bridge_port.number}"})
            for name in (SECOND, THIRD):
                self.serve(name)
            self.serve(BRIDGES, FLEET_BRIDGE_HOST=BRIDGE_HOST)
            self.listener.close()
            self._start_nginx()
            self._start_caddy()
        except BaseException:
            self.end_processes()
            raise

    def serve(self, name: str, **settings: str) -> Child:
        """Run `script/serve` on a computer, and wait until it is ready."""
        role = name if name in (CONSOLE, BRIDGES) else "web"
        words = [] if role == BRIDGES else ["--behind-proxy", "--port", str(self.port_of(name))]
        environment = {**self.environment, **self.places(name), **settings}
        child = self.start_child(name, ["script/serve", role, *words], environment)
        until(lambda: not child.running or "ends it." in self.said(name), f"{name} serves", READY_S)
        self.check()
        return child

    def places(self, name: str) -> dict[str, str]:
        """Return the settings of a computer's own folders."""
        places = {"FLEET_VAR": self.directory / name, "FLEET_RUN_DIR": self._sockets / name}
        for place in places.values():
            place.mkdir(mode=0o700, exist_ok=True)
        return {variable: str(place) for variable, place in places.items()}

    def said(self, name: str) -> str:
        """Return the log of a computer."""
        return (self.logs / f"{name}.log").read_text(errors="replace")

    def process(self, name: str, words: str) -> int:
        """Return the id of the process of a computer whose command line contains these words."""
        [child] = [child for child in self.children if child.name == name]
        return Family(child.pid).named(words)

    def port_of(self, name: str) -> int:
        """Return the port of a web process, of the proxy before it alone (`front-...`), or of Caddy."""
        return self._ports[name].number

    def set_bridge_addresses(self, addresses: Mapping[str, str]) -> None:
        """Enter the bridge addresses of robots."""
        self._finish(self.manage("addresses", "shell", "-c", ADDRESSES.format(dict(addresses))))

    def wait_ready(self, timeout_s: float = READY_S) -> None:
        """Wait until the robots are online."""
        deadline = time.monotonic() + timeout_s
        for slug, name in ((NEAR, BRIDGES), (FAR, CONSOLE)):
            robot = self.robots[slug]
            robot.link_path = str(self._sockets / name / Path(robot.link_path).name)
            self.wait_online(slug, deadline)

    # --- proxies -----------------------------------------------------------------------------------

    def _start_nginx(self) -> None:
        """Run nginx before all web processes, and before each of them alone, so that a test can choose one."""
        sites = {"all": (self.port, WEBS)} | {web: (self.port_of(f"front-{web}"), (web,)) for web in WEBS}
        place = self.directory / "nginx"
        place.mkdir()
        for name, (port, webs) in sites.items():
            (place / f"{name}.conf").write_text(self._nginx_site(name, port, webs))
        temporary = "".join(
            f"{kind}_temp_path {place}/{kind};"
            for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        )
        (place / "nginx.conf").write_text(
            f"user root root; daemon off; pid {place}/pid; error_log stderr warn; events {{}}\n"
            f"http {{ {temporary} include {place}/all.conf; "
            + " ".join(f"include {place}/{web}.conf;" for web in WEBS)
            + "}\n"
        )
        self.start_child(
            "nginx", ["nginx", "-p", str(place), "-c", str(place / "nginx.conf")], self.environment
        )
        until(lambda: listens(self.port), "nginx listens", READY_S)

    def _nginx_site(self, name: str, port: int, webs: Sequence[str]) -> str:
        """Return deploy/nginx.conf with the lines that its reader has to change, and with names of its own."""
        assert self.certificate
        redirect = ReservedPort()
        self._closing.callback(redirect.close)
        server = "    server 127.0.0.1:8000"
        [line] = [line for line in _shipped("nginx.conf").splitlines() if line.startswith(server)]
        return _changed(
            re.sub(r"^ *listen \[::\].*\n", "", _shipped("nginx.conf"), flags=re.MULTILINE),
            {
                line: "\n".join(line.replace("8000", str(self.port_of(web))) for web in webs),
                "listen 80;": f"listen 127.0.0.1:{redirect.number};",
                "listen 443 ": f"listen 127.0.0.1:{port} ",
                "server_name fleet.lab.example;": "server_name localhost;",
                "error_log /var/log/nginx/error.log alert;": "error_log stderr alert;",
                "/etc/ssl/fleet.crt": str(self.certificate.certificate),
                "/etc/ssl/private/fleet.key": str(self.certificate.private_key),
                "$fleet_": f"$fleet_{name}_",
                "upstream fleet ": f"upstream fleet_{name} ",
                "http://fleet;": f"http://fleet_{name};",
                "shared:fleet:": f"shared:fleet_{name}:",
            },
        )

    def _start_caddy(self) -> None:
        assert self.certificate
        port, place = self.port_of("caddy"), self.directory / "caddy"
        place.mkdir()
        webs = " ".join(f"127.0.0.1:{self.port_of(web)}" for web in WEBS)
        tls = f"tls {self.certificate.certificate} {self.certificate.private_key}"
        site = _changed(
            _shipped("Caddyfile"),
            {
                "unix//var/lib/caddy/admin.sock": f"unix/{place}/admin.sock\n\tauto_https disable_redirects",
                "fleet.lab.example {": f"https://localhost:{port} {{\n\tbind 127.0.0.1\n\t{tls}",
                "127.0.0.1:8000": webs,
            },
        )
        (place / "Caddyfile").write_text(site)
        words = ["caddy", "run", "--config", str(place / "Caddyfile"), "--adapter", "caddyfile"]
        own = {"XDG_DATA_HOME": str(place), "XDG_CONFIG_HOME": str(place), "HOME": str(place)}
        self.start_child("caddy", words, {**self.environment, **own})
        until(lambda: listens(port), "Caddy listens", READY_S)


def _shipped(name: str) -> str:
    return (REPOSITORY / "deploy" / name).read_text()


def _changed(text: str, changes: Mapping[str, str]) -> str:
    for before, after in changes.items():
        assert before in text, f"{before!r} is not in the shipped file"
        text = text.replace(before, after)
    return text


@contextmanager
def running_computers(directory: Path) -> Iterator[Computers]:
    """Run the computers; their files are in `directory`."""
    with ExitStack() as stack:
        url = stack.enter_context(postgresql())
        redis = Redis(Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="fleet-redis-"))))
        stack.callback(redis.kill)
        servers = {"FLEET_DATABASE_URL": url, "FLEET_REDIS_URL": redis.url}
        yield stack.enter_context(Computers(directory / "lab", servers))
