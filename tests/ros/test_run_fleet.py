"""``manage.py run_fleet`` with real bridges: one robot is present, the other is not."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator

import psutil
import pytest
from django.db import connection

from robots.registry.models import BridgeStatus, Robot
from robots.registry.selectors import link_address
from robots.registry.services import robot_save
from tests.processes import PATIENCE_S, REPOSITORY, end, until
from tests.ros.support import Master

pytestmark = pytest.mark.django_db(transaction=True)


class Supervisor:
    """The command as a lab runs it, with the test's database."""

    def __init__(self) -> None:
        database = f"sqlite:///{connection.settings_dict['NAME']}"
        self.process = subprocess.Popen(
            [sys.executable, "manage.py", "run_fleet"],
            cwd=REPOSITORY,
            env={**os.environ, "FLEET_DATABASE_URL": database, "DJANGO_SETTINGS_MODULE": "fleet.settings"},
            stdin=subprocess.DEVNULL,
        )

    def bridge_of(self, robot: Robot, not_pid: int | None = None) -> psutil.Process:
        """Wait until the robot's bridge listens; return its process."""
        until(lambda: listens(robot) and self._pid(robot) not in (None, not_pid), f"bridge of {robot.slug}")
        return psutil.Process(self._pid(robot))

    def watchdog_of(self, robot: Robot, not_pid: int | None = None) -> psutil.Process:
        """Wait until the robot's watchdog listens; return its process."""

        path = (link_address(robot).unix_path or "").replace(".sock", ".stop")

        def listening() -> psutil.Process | None:
            for child in psutil.Process(self.process.pid).children():
                with contextlib.suppress(psutil.Error):  # the process has ended and is not reaped yet
                    arguments = child.cmdline()
                    if (
                        "robots.bridge.watchdog" in arguments
                        and path in arguments[-1]
                        and child.pid != not_pid
                    ):
                        return child if connects(path, socket.SOCK_SEQPACKET) else None
            return None

        found: psutil.Process = until(listening, f"watchdog of {robot.slug}")
        return found

    def _pid(self, robot: Robot) -> int | None:
        assert self.process.poll() is None, "the supervisor ended"
        return BridgeStatus.objects.filter(robot=robot).values_list("pid", flat=True).first()


def listens(robot: Robot) -> bool:
    path = link_address(robot).unix_path
    assert path is not None
    return connects(path)


def connects(path: str, kind: int = socket.SOCK_STREAM) -> bool:
    with socket.socket(socket.AF_UNIX, kind) as probe:
        return probe.connect_ex(path) == 0


@pytest.fixture
def away(other_robot: Robot) -> Robot:
    """A robot without a running master."""
    return other_robot


@pytest.fixture
def there(robot: Robot, rosmaster: Master) -> Robot:
    """A robot with a running master."""
    robot.master_uri, robot.advertised_address = rosmaster.uri, "127.0.0.1"
    robot.save()
    return robot


@pytest.fixture
def supervisor(there: Robot, away: Robot) -> Iterator[Supervisor]:
    supervisor = Supervisor()
    yield supervisor
    end(supervisor.process)


def test_an_edit_reaches_its_own_bridge_and_no_other(
    supervisor: Supervisor, there: Robot, away: Robot
) -> None:
    first, untouched = supervisor.bridge_of(there), supervisor.bridge_of(away)
    there.overrides = {"limits": {"forward_mps": 0.5}}
    robot_save(robot=there, actor=None)
    supervisor.bridge_of(there, not_pid=first.pid)
    assert not first.is_running()
    assert supervisor.bridge_of(away) == untouched


def test_a_bridge_that_is_killed_comes_back(supervisor: Supervisor, there: Robot) -> None:
    first = supervisor.bridge_of(there)
    first.kill()
    supervisor.bridge_of(there, not_pid=first.pid)


def test_a_watchdog_runs_per_bridge_and_comes_back(supervisor: Supervisor, there: Robot, away: Robot) -> None:
    supervisor.bridge_of(there)
    first = {robot: supervisor.watchdog_of(robot) for robot in (there, away)}
    first[there].kill()
    again = supervisor.watchdog_of(there, not_pid=first[there].pid)
    assert supervisor.watchdog_of(away) == first[away]
    end(supervisor.process)
    assert not again.is_running()


def test_every_bridge_ends_with_its_supervisor_however_that_ends(
    supervisor: Supervisor, there: Robot, away: Robot
) -> None:
    bridges = [supervisor.bridge_of(there), supervisor.bridge_of(away)]
    supervisor.process.kill()
    _, alive = psutil.wait_procs(bridges, timeout=PATIENCE_S)
    assert alive == []
    supervisor.process.wait()
    again = Supervisor()
    try:
        assert again.bridge_of(there, not_pid=bridges[0].pid).is_running()
    finally:
        assert end(again.process) == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_supervisor_and_bridges_in_order(
    supervisor: Supervisor, there: Robot, number: signal.Signals
) -> None:
    bridge = supervisor.bridge_of(there)
    supervisor.process.send_signal(number)
    assert supervisor.process.wait(PATIENCE_S) == 0
    assert not bridge.is_running()
    assert BridgeStatus.objects.get(robot=there).state == BridgeStatus.State.STOPPED
