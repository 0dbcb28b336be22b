"""A computer joins a running console as a bridge host and runs a robot's bridge; here on the same computer."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest

from script.stack.certificates import certificate_for, lan_addresses
from script.stack.places import REPOSITORY
from script.stack.processes import Child, end_all
from script.stack.stack import Certificate
from tests.processes import free_port, outside, until
from tests.script.servers import postgresql_installed, running_postgresql

READY_S = 120.0
ADDRESS = next(iter(lan_addresses()), "")  # a database at 127.0.0.1 would be out of reach for others

NEW_CODE = """
from fleet.accounts.models import User
from robots.registry import bridge_hosts
from robots.registry.models import BridgeHost
assert bridge_hosts.why_not() == "", bridge_hosts.why_not()
staff = User.objects.create_user("first", is_staff=True, is_superuser=True)
print("code", bridge_hosts.code_make(BridgeHost(name="{host}"), staff))
"""
NEW_ROBOT = """
from robots.registry import bridge_hosts, services
from robots.registry.models import Robot, RobotProfile
[address] = bridge_hosts.free_addresses()
robot = Robot(slug="far", name="Far", profile=RobotProfile.objects.get(slug="tiago"), bridge_address=address)
robot.master_uri = "http://127.0.0.1:9"  # no robot is there
services.robot_save(robot=robot, actor=None)
"""
LINKED = """
from robots.link.connections import open_sync
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from msgspec.structs import replace
with open_sync(replace(link_address(Robot.objects.get(slug="far")), unix_path="")) as link:
    print("linked by", link.socket.version())
"""


@dataclass
class Console:
    """A console with TLS and a database that other computers reach."""

    environment: dict[str, str]
    certificate: Certificate
    port: int

    def shell(self, program: str) -> str:
        return run([sys.executable, "manage.py", "shell", "-v", "0", "-c", program], self.environment)


def run(command: list[str], environment: dict[str, str], status: int = 0) -> str:
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert done.returncode == status, done.stdout
    return done.stdout


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Console]:
    with ExitStack() as stack:
        database = stack.enter_context(running_postgresql(address=ADDRESS))
        environment = {
            **outside(),
            "FLEET_SECRET_KEY": "k" * 40,
            "FLEET_LINK_SECRET": "l" * 40,
            "FLEET_HOSTS": ADDRESS,
            "FLEET_TLS": "1",
            "FLEET_VAR": str(tmp_path / "console"),
            "FLEET_DATABASE_URL": database.url,
        }
        certificate = certificate_for([ADDRESS], tmp_path / "tls")
        files = ["--certificate", str(certificate.certificate), "--private-key", str(certificate.private_key)]
        made = Console(environment, certificate, free_port())
        words = ["--bind", ADDRESS, "--port", str(made.port), *files]
        log = tmp_path / "console.log"
        serve = Child("console", ["script/serve", *words], env=environment, log=log)
        stack.callback(end_all, [serve])
        until(lambda: "Serving on" in log.read_text() or not serve.running, "the console serves", READY_S)
        assert serve.running, log.read_text()
        yield made


@pytest.mark.skipif(
    not ADDRESS or not postgresql_installed(), reason="no network address, or no PostgreSQL here"
)
def test_a_computer_joins_and_runs_the_bridge_of_a_robot(console: Console, tmp_path: Path) -> None:
    code = console.shell(NEW_CODE.format(host=ADDRESS)).split()[-1]
    env = tmp_path / "fleet.env"
    address = f"https://{ADDRESS}:{console.port}/bridge-hosts/join/"
    join = [
        sys.executable,
        "-m",
        "script.service.join",
        address,
        code,
        "--env",
        str(env),
        "--owner",
        tmp_path.owner(),
    ]
    refused = run(join, outside(), status=1)
    assert "certificate verify failed" in refused and "FLEET_JOIN_CA" in refused  # it trusts nobody blindly
    trusting = {**outside(), "FLEET_JOIN_CA": str(console.certificate.authority)}
    assert f"Joined as {ADDRESS}." in run(join, trusting)
    assert env.stat().st_mode & 0o77 == 0 and env.with_suffix(".key").stat().st_mode & 0o77 == 0
    assert f"{env.with_suffix('.key')}, {tmp_path}/fleet-authority.crt: there" in run(
        join, trusting, status=1
    )
    join[join.index(str(env))] = str(tmp_path / "again.env")
    assert "The console refused: This code is wrong, used or too old" in run(join, trusting, status=1)
    console.shell(NEW_ROBOT)

    settings = dict(line.split("=", 1) for line in env.read_text().splitlines())
    own = {name: "".join(shlex.split(value)) for name, value in settings.items()}
    host = {**outside(), **own, "FLEET_VAR": str(tmp_path / "host")}
    log = tmp_path / "host.log"
    bridges = Child("bridges", ["script/serve", "bridges"], env=host, log=log)
    try:
        until(lambda: "Bridge of far starts" in log.read_text() or not bridges.running, "its bridge", READY_S)
        assert "Housekeeping" not in log.read_text()
        run(["script/serve", "bridges", "--is-ready"], host)
        until(lambda: linked(console), "the web side reaches the bridge", READY_S)
        # As this computer reaches bridges of others, to stop their robots.
        assert "linked by TLSv1.3" in run(
            [sys.executable, "manage.py", "shell", "-v", "0", "-c", LINKED], host
        )
    finally:
        end_all([bridges])
        print(log.read_text())


def linked(console: Console) -> bool:
    try:
        return "linked by TLSv1.3" in console.shell(LINKED)
    except AssertionError:  # the bridge does not listen yet
        return False
