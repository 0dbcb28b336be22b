"""An administrator's way on an empty Debian 12, as the docs say: clone, install, robot, upgrade, backup, restore.

Each step is a function that gets the machine; the next step finds what the last one left.
"""

from __future__ import annotations

import os
import re
import signal
import urllib.request
from collections.abc import Iterator

import pytest

from script.stack.stack import Account
from tests.processes import free_port, until
from tests.script.first_run import set_up
from tests.script.installed.machine import INSTALLED_S, Machine, empty_machine, missing
from tests.script.support import Family

pytestmark = [pytest.mark.skipif(bool(missing()), reason=missing()), pytest.mark.timeout(INSTALLED_S)]

STAFF = Account("first", "staff", "a long walk on the beach")
STARTS_S = 120.0
ROBOTS = "from robots.registry.models import Robot"
EARLIER = "2cf358f6"  # the first state that installs itself here; from 1.0.0 on: the release before


@pytest.fixture
def machine() -> Iterator[Machine]:
    with empty_machine() as machine:
        yield machine


def test_an_administrator_installs_and_runs_the_console(machine: Machine) -> None:
    port = free_port()
    machine.clone(EARLIER)
    wrong_settings_are_shown(machine, port)
    first_page_leads_to_a_robot(machine)
    the_service_may_do_little_and_keeps_its_priority(machine)
    the_log_has_priorities(machine)
    a_dead_web_process_comes_back(machine, port)
    giving_up_is_said(machine)
    an_upgrade_keeps_everything(machine, port)
    a_backup_brings_back_what_was(machine, port)


def wrong_settings_are_shown(machine: Machine, port: int) -> None:
    (machine.root / "etc/fleet.env").write_text("FLEET_SECRET_KEY=short\nFLEET_HOSTS=localhost\n")
    said = machine.shell(f"script/install-service -- --port {port}; echo status $?", check=False)
    assert "FLEET_SECRET_KEY has 5 characters; it needs 32 or more." in said
    assert "fleet does not run: the lines above say why." in said
    assert said.endswith("status 1\n")
    assert machine.run("systemctl", "is-active", "fleet", check=False) == "inactive\n"  # not again and again
    (machine.root / "etc/fleet.env").unlink()


def first_page_leads_to_a_robot(machine: Machine) -> None:
    said = machine.shell("script/install-service")  # with the words of before
    assert "Wrote /etc/fleet.env." in said and "fleet runs, and starts again after a reboot." in said
    page = set_up(said, STAFF, "TIAGo 42", "http://127.0.0.1:9")  # no robot is there
    assert "Is the robot on, and in this network?" in page
    until(lambda: "Bridge of tiago-42 starts" in machine.log("fleet"), "the robot's bridge starts", STARTS_S)
    assert machine.run("stat", "-c", "%U %a", "/var/lib/fleet") == "fleet 700\n"
    assert machine.shell("stat -c %U var .venv").split() == [
        "root",
        "root",
    ]  # the service cannot change itself


def the_service_may_do_little_and_keeps_its_priority(machine: Machine) -> None:
    judged = machine.run("systemd-analyze", "security", "--no-pager", "fleet")
    [exposure] = re.findall(r"Overall exposure level for fleet.service: ([0-9.]+)", judged)
    assert float(exposure) <= 3.0
    machine.shell("mv .venv/ready-web var/")
    asked = machine.shell("runuser -u fleet -- script/setup web", check=False)
    assert (
        "parts are missing, and fleet may not install them: run sudo script/install-service again." in asked
    )
    machine.shell("mv var/ready-web .venv/")
    # This computer may not let a machine raise the limit itself (LimitRTPRIO=): so with the right instead.
    ours = (machine.root / "etc/systemd/system/fleet.service").read_text()
    limits = re.search(r"^NoNewPrivileges=.*?(?=^$)", ours, re.MULTILINE | re.DOTALL)
    assert limits
    right = "CapabilityBoundingSet=CAP_SYS_NICE\nAmbientCapabilities=CAP_SYS_NICE\n"
    service = f"Type=oneshot\nUser=fleet\n{limits[0]}{right}ExecStart=/usr/bin/chrt --fifo 5 /bin/true\n"
    (machine.root / "etc/systemd/system/fleet-probe-priority.service").write_text(f"[Service]\n{service}")
    machine.run("systemctl", "daemon-reload")
    machine.run("systemctl", "start", "fleet-probe-priority")


def the_log_has_priorities(machine: Machine) -> None:
    warnings = machine.run("journalctl", "-u", "fleet", "-p", "warning", "-o", "cat", "--no-pager")
    assert "Bridge of tiago-42 starts" not in warnings


def a_dead_web_process_comes_back(machine: Machine, port: int) -> None:
    os.kill(Family(machine.leader).named("fleet.server --verbosity"), signal.SIGKILL)
    said = "web was ended by SIGKILL; it is started again in 0.5 s."
    until(
        lambda: said in machine.run("journalctl", "-u", "fleet", "-p", "warning", "-o", "cat"), said, STARTS_S
    )
    until(lambda: answers(port), "the web process is back", STARTS_S)


def answers(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://localhost:{port}/livez", timeout=5.0) as page:
            return bool(page.status == 200)
    except OSError:
        return False


def giving_up_is_said(machine: Machine) -> None:
    """Systemd gives up a service like ours, whose program fails at once."""
    unit = machine.root / "etc/systemd/system/fleet-probe.service"
    ours = (machine.root / "etc/systemd/system/fleet.service").read_text()
    limits = "\n".join(re.findall(r"^(?:StartLimit|OnFailure).*$", ours, re.MULTILINE))
    service = "[Service]\nExecStart=/bin/false\nRestart=on-failure\nRestartSec=0\n"
    unit.write_text(f"[Unit]\n{limits}\n{service}")
    machine.run("systemctl", "daemon-reload")
    machine.run("systemctl", "start", "--no-block", "fleet-probe")
    said = "fleet-probe has ended 5 times within 5 minutes: systemd does not start it again."
    until(lambda: said in machine.run("journalctl", "-p", "crit", "-o", "cat", "--no-pager"), said, STARTS_S)


def an_upgrade_keeps_everything(machine: Machine, port: int) -> None:
    """As docs/upgrade.md says."""
    machine.run("systemctl", "stop", "fleet")
    machine.checkout("HEAD")
    assert "fleet runs, and starts again after a reboot." in machine.shell("script/install-service")
    assert answers(port)
    assert robots(machine) == ["tiago-42"]


def a_backup_brings_back_what_was(machine: Machine, port: int) -> None:
    """As docs/backup.md says: back up now, go back on the same computer."""
    machine.run("install", "-d", "-m", "700", "-o", "fleet", "/var/backups/fleet")
    machine.shell("script/manage backup /var/backups/fleet --verify")
    lose = f"{ROBOTS}; Robot.objects.update(slug='lost')"
    machine.run("script/manage", "shell", "-v", "0", "-c", lose, cwd="/opt/fleet")
    assert robots(machine) == ["lost"]
    machine.run("systemctl", "stop", "fleet")
    machine.shell("script/manage restore /var/backups/fleet/fleet-*.tar.gz --replace")
    machine.run("systemctl", "start", "fleet")  # waits until it is ready
    assert answers(port)
    assert robots(machine) == ["tiago-42"]
    assert "A backup is made each night" in machine.shell("script/install-backup /var/backups/fleet")
    machine.run("systemctl", "is-active", "fleet-backup.timer")


def robots(machine: Machine) -> list[str]:
    program = f"{ROBOTS}; print(*Robot.objects.values_list('slug', flat=True))"
    return machine.run("script/manage", "shell", "-v", "0", "-c", program, cwd="/opt/fleet").split()
