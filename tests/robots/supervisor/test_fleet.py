"""The supervisor follows the registry, robot by robot. Bridges are real processes of a fake program."""

from __future__ import annotations

import errno
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, nullcontext
from pathlib import Path
from socket import gethostname
from unittest import mock
from uuid import UUID

import pytest
from django.conf import settings
from django.db import OperationalError, connection
from django.test import override_settings
from django.test.utils import CaptureQueriesContext

from robots.link.connections import why_down
from robots.registry import stored_robots
from robots.registry.models import Allowance, BridgeStatus, Robot, RobotProfile
from robots.registry.selectors import link_address
from robots.shared.processes.one_supervisor import LOCK, AlreadySupervised, only_instance
from robots.supervisor.claims import CONSOLE
from robots.supervisor.fleet_supervisor import Fleet, wait_shortly
from tests.processes import until
from tests.robots.support import FakePrograms

pytestmark = pytest.mark.django_db

State = BridgeStatus.State
QUIET = ("-c", "import sys; sys.stdin.read()")  # a program that does nothing, instead of watchdogs


class Supervised:
    """A supervisor that does its steps while a test waits for a condition."""

    def __init__(self, programs: FakePrograms, only: frozenset[str] = frozenset()) -> None:
        self.programs = programs
        self.fleet = Fleet(only, programs.script, QUIET, [str(programs.script)])

    def until(self, condition: Callable[[], object], what: str) -> None:
        until(lambda: (self.fleet.step(time.monotonic()), condition())[1], what)

    def until_started(self, slug: str, times: int) -> None:
        self.until(lambda: len(self.programs.pids(slug)) >= times, f"start {times} of {slug}")

    def state(self, robot: Robot) -> str:
        return BridgeStatus.objects.get(robot=robot).state


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakePrograms:
    programs = FakePrograms(tmp_path)
    monkeypatch.setenv("FAKE_LOG", str(programs.log))
    return programs


@pytest.fixture
def supervised(programs: FakePrograms, robot: Robot, other_robot: Robot) -> Iterator[Supervised]:
    supervised = Supervised(programs)
    yield supervised
    supervised.fleet.end_programs()


def test_every_robot_gets_a_bridge_the_fleet_its_other_programs(supervised: Supervised) -> None:
    for name in ("tiago-1", "tiago-2", "run_records", "run_housekeeping"):
        supervised.until_started(name, 1)


@override_settings(FLEET_S3=object())
def test_a_console_with_an_object_store_moves_recordings_there(programs: FakePrograms, robot: Robot) -> None:
    supervised = Supervised(programs)
    try:
        supervised.until_started("run_store", 1)
    finally:
        supervised.fleet.end_programs()


def test_a_poll_without_a_change_makes_one_query(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    supervised.until(lambda: supervised.state(robot) == State.RUNNING, "the bridge runs")
    with CaptureQueriesContext(connection) as queries:
        supervised.fleet._poll()
    assert len(queries) == 1


def test_an_edit_of_the_allow_list_restarts_the_bridge(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    Allowance.objects.create(robot=robot, what="publish", name="/lamp", type="std_msgs/Bool")
    supervised.until_started("tiago-1", 2)


def test_an_edit_restarts_only_its_bridge_within_3_s(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    supervised.until_started("tiago-2", 1)
    robot.drive_topic = "/phone_vel"
    robot.save()
    edited_s = time.monotonic()
    supervised.until_started("tiago-1", 2)
    assert time.monotonic() - edited_s < 3.0
    assert len(supervised.programs.pids("tiago-2")) == 1
    assert supervised.programs.lines().count("end tiago-1") == 1


def test_an_edit_of_the_profile_reaches_every_robot_of_that_kind(
    supervised: Supervised, robot: Robot
) -> None:
    supervised.until_started("tiago-1", 1)
    supervised.until_started("tiago-2", 1)
    robot.profile.blind_mps = 0.2
    robot.profile.save()
    supervised.until_started("tiago-1", 2)
    supervised.until_started("tiago-2", 2)


def test_a_disabled_robot_loses_its_bridge_and_gets_it_back(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    robot.enabled = False
    robot.save()
    supervised.until(lambda: "end tiago-1" in supervised.programs.lines(), "the end of the bridge")
    assert supervised.state(robot) == State.DISABLED
    robot.enabled = True
    robot.save()
    supervised.until_started("tiago-1", 2)
    assert supervised.state(robot) == State.STARTING


def test_a_robot_added_while_running_gets_a_bridge(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    Robot.objects.create(
        slug="tiago-3", name="TIAGo 3", profile=robot.profile, master_uri="http://127.0.0.1:9"
    )
    supervised.until_started("tiago-3", 1)


def test_web_processes_are_told_why_no_bridge_runs(
    supervised: Supervised, robot: Robot, request: pytest.FixtureRequest
) -> None:
    """An entry of an earlier version may have an address that is refused now."""

    def refusal() -> str:
        return why_down(FileNotFoundError(), link_address(robot)).text

    supervised.until_started("tiago-1", 1)
    assert refusal().startswith(f"No supervisor runs on this computer ({gethostname()})")
    lock = ExitStack()
    lock.enter_context(only_instance(settings.FLEET_RUN_DIR / LOCK))
    request.addfinalizer(lock.close)
    assert refusal() == "The robot’s bridge is not running; staff can start it."
    Robot.objects.filter(pk=robot.pk).update(master_uri="http://[::1]:11311")
    supervised.until(lambda: "has an IPv6 address" in refusal(), "the reason")
    assert refusal().startswith("The robot’s bridge is not running: 'http://[::1]:11311' has")
    Robot.objects.filter(pk=robot.pk).update(master_uri="http://127.0.0.1:9")
    supervised.until(lambda: "staff can start it" in refusal(), "a bridge that runs")


def test_a_wrong_robot_is_refused_and_the_others_run(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    robot.overrides = {"topics": {"odometry": None}}
    robot.save()
    supervised.until(lambda: "end tiago-1" in supervised.programs.lines(), "the end of the bridge")
    status = BridgeStatus.objects.get(robot=robot)
    assert (status.state, status.detail) == (State.REFUSED, "odometry: Expected an object, got null")
    assert len(supervised.programs.pids("tiago-2")) == 1


def test_a_robot_whose_ros_is_not_installed_says_what_to_do(
    supervised: Supervised, robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready = tmp_path / "ready"  # written when rclpy is installed
    monkeypatch.setattr("robots.shared.ros2.environment.READY", ready)
    supervised.until_started("tiago-1", 1)
    Robot.objects.filter(pk=robot.pk).update(profile=RobotProfile.objects.get(slug="tiago-ros2"))
    supervised.until(lambda: "end tiago-1" in supervised.programs.lines(), "the end of the bridge")
    status = BridgeStatus.objects.get(robot=robot)
    assert (status.state, "script/setup ros2" in status.detail) == (State.REFUSED, True)
    ready.touch()
    supervised.until_started("tiago-1", 2)


def test_a_full_disk_blocks_one_edit_and_ends_no_bridge(supervised: Supervised, robot: Robot) -> None:
    supervised.until_started("tiago-1", 1)
    supervised.until_started("tiago-2", 1)
    full = OSError(errno.ENOSPC, "No space left on device")
    environment = mock.patch("robots.supervisor.fleet_supervisor.ros_environment", side_effect=full)
    with environment as asked:
        Robot.objects.filter(pk=robot.pk).update(drive_topic="/phone_vel")
        supervised.until(lambda: asked.call_count >= 2, "two looks")
        status = BridgeStatus.objects.get(robot=robot)
    assert "No space left on device" in status.detail
    assert status.pid == supervised.programs.pids("tiago-1")[0]
    assert not any(line.startswith("end") for line in supervised.programs.lines())
    supervised.until_started("tiago-1", 2)  # a new start with the edit, when the disk has space again


def test_a_falling_bridge_is_shown_with_its_reason(supervised: Supervised, robot: Robot) -> None:
    (supervised.programs.folder / "crash-tiago-1").touch()
    supervised.until(
        lambda: BridgeStatus.objects.filter(robot=robot, state=State.BACKING_OFF).exists(), "the fall"
    )
    assert "ended by itself with code 7" in BridgeStatus.objects.get(robot=robot).detail


@pytest.mark.parametrize(
    "query", [(stored_robots.rows, "read"), (Robot.objects, "select_related"), (Allowance.objects, "filter")]
)
def test_a_silent_database_leaves_the_fleet_unchanged(
    supervised: Supervised, robot: Robot, query: tuple[object, str], caplog: pytest.LogCaptureFixture
) -> None:
    supervised.until_started("tiago-1", 1)
    robot.drive_topic = "/phone_vel"
    robot.save()
    broken = mock.patch.object(*query, side_effect=OperationalError("disk I/O error"))
    with broken as asked, mock.patch("robots.supervisor.fleet_supervisor.connection"):
        supervised.until(lambda: asked.call_count >= 2, "two polls")
    assert caplog.text.count("The database cannot be used, the fleet stays as it is") == 1
    assert supervised.programs.lines().count("end tiago-1") == 0
    supervised.until_started("tiago-1", 2)


def test_the_end_lets_every_program_go(supervised: Supervised, robot: Robot) -> None:
    names = ["tiago-1", "tiago-2", "run_records", "run_housekeeping"]
    for name in names:
        supervised.until_started(name, 1)
    supervised.fleet.end_programs()
    assert sorted(line for line in supervised.programs.lines() if line.startswith("end")) == sorted(
        f"end {name}" for name in names
    )
    assert supervised.state(robot) == State.STOPPED


ELSEWHERE = "wss://other-host:7443"


def test_a_remote_bridge_is_left_to_its_own_host(supervised: Supervised, other_robot: Robot) -> None:
    Robot.objects.filter(pk=other_robot.pk).update(bridge_address=ELSEWHERE)
    supervised.until_started("tiago-1", 1)
    supervised.until_started("run_housekeeping", 1)
    assert supervised.programs.pids("tiago-2") == []
    assert not BridgeStatus.objects.filter(robot=other_robot).exists()  # its status is also not written


@override_settings(
    FLEET_BRIDGE_HOST="other-host",
    FLEET_LINK_CA=None,
    FLEET_LINK_CERT=None,
    FLEET_LINK_KEY=None,
    FLEET_LINK_SECRET="of both sides",
)
def test_the_console_runs_robots_with_addresses_of_its_own(
    programs: FakePrograms, other_robot: Robot
) -> None:
    """They need no certificate but the one that the console makes itself."""
    Robot.objects.filter(pk=other_robot.pk).update(bridge_address=ELSEWHERE)
    supervised = Supervised(programs)
    try:
        supervised.until_started("tiago-2", 1)
    finally:
        supervised.fleet.end_programs()


@override_settings(
    FLEET_LINK_CERT="bridge.pem", FLEET_LINK_KEY="bridge.key", FLEET_LINK_SECRET="of both sides"
)
def test_a_bridge_host_runs_the_robots_of_its_name(programs: FakePrograms, other_robot: Robot) -> None:
    Robot.objects.filter(pk=other_robot.pk).update(bridge_address=ELSEWHERE)
    fleet = Fleet(frozenset(), programs.script, QUIET, [str(programs.script)], host="Other-Host")
    try:
        until(lambda: (fleet.step(time.monotonic()), programs.pids("tiago-2"))[1], "its bridge")
        until(lambda: programs.pids("run_records"), "its records process")
        started = {line.split()[1] for line in programs.lines()}
        assert started == {"tiago-2", "run_records"}  # no other robot, no housekeeping
    finally:
        fleet.end_programs()


@override_settings(FLEET_LINK_CERT="bridge.pem", FLEET_LINK_KEY=None, FLEET_LINK_SECRET=None)
def test_a_network_bridge_names_its_missing_settings(programs: FakePrograms, other_robot: Robot) -> None:
    Robot.objects.filter(pk=other_robot.pk).update(bridge_address=ELSEWHERE)
    fleet = Fleet(frozenset({"tiago-2"}), programs.script)
    fleet.step(time.monotonic())
    status = BridgeStatus.objects.get(robot=other_robot)
    fleet.end_programs()
    assert status.state == State.REFUSED
    assert "needs FLEET_LINK_KEY, FLEET_LINK_SECRET to be set" in status.detail
    assert programs.pids("tiago-2") == []


@pytest.mark.skipif(connection.vendor != "sqlite", reason="locks the file of the database")
@pytest.mark.django_db(transaction=True)
def test_a_locked_database_holds_no_bridge_up(programs: FakePrograms, robot: Robot) -> None:
    wait_shortly()
    supervised = Supervised(programs)
    path = str(connection.settings_dict["NAME"])
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")  # holds the write lock
            began_s = time.monotonic()
            supervised.until_started("tiago-1", 1)
            assert time.monotonic() - began_s < 4.0  # SQLite by default waits 5 s for a lock
            other.execute("ROLLBACK")
        supervised.until(lambda: supervised.state(robot) == State.RUNNING, "the state, told late")
    finally:
        supervised.fleet.end_programs()
        connection.close()
        connection.settings_dict["OPTIONS"]["timeout"] = 5


def test_one_of_several_hosts_runs_only_its_robots(
    programs: FakePrograms, robot: Robot, other_robot: Robot
) -> None:
    supervised = Supervised(programs, frozenset({"tiago-2"}))
    try:
        supervised.until_started("tiago-2", 1)
        assert programs.pids("tiago-1") == []
        assert supervised.fleet._housekeeping.idle  # the host of the other robots does the housekeeping
    finally:
        supervised.fleet.end_programs()


class Taken:
    """Claims of which another supervisor has some."""

    def __init__(self, fleet: Fleet) -> None:
        self.elsewhere: dict[UUID, str] = {}
        self.kept: list[UUID] = []
        fleet._claims = self  # type: ignore[assignment]

    def take(self, wanted: list[UUID]) -> dict[UUID, str]:
        return {one: self.elsewhere[one] for one in wanted if one in self.elsewhere}

    def keep(self, wanted: list[UUID]) -> None:
        self.kept = wanted


def test_a_robot_of_another_supervisor_is_left_alone(
    supervised: Supervised, other_robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    taken = Taken(supervised.fleet)
    taken.elsewhere[other_robot.id] = "computer-2, process 7"
    supervised.until_started("tiago-1", 1)
    supervised.until_started("run_housekeeping", 1)
    assert supervised.programs.pids("tiago-2") == []
    assert not BridgeStatus.objects.filter(robot=other_robot).exists()
    assert (
        "computer-2, process 7 runs this robot"
        in why_down(FileNotFoundError(), link_address(other_robot)).text
    )
    taken.elsewhere.clear()
    supervised.until_started("tiago-2", 1)
    supervised.until(lambda: supervised.state(other_robot) == State.RUNNING, "the report")
    assert caplog.text.count("computer-2, process 7 runs this robot") == 1


def test_a_robot_that_was_taken_over_ends_here_unreported(supervised: Supervised, robot: Robot) -> None:
    taken = Taken(supervised.fleet)
    supervised.until_started("tiago-1", 1)
    BridgeStatus.objects.filter(robot=robot).update(pid=4711)  # the other one's report
    taken.elsewhere[robot.id] = "computer-2, process 7"
    supervised.until(lambda: "end tiago-1" in supervised.programs.lines(), "the end of the bridge")
    assert robot.id in taken.kept
    supervised.fleet.end_programs()
    assert BridgeStatus.objects.get(robot=robot).pid == 4711


@pytest.mark.parametrize(
    ("only", "host", "starts"),
    [(set(), "", True), ({"tiago-1"}, "", True), ({"tiago-2"}, "", False), (set(), "other-host", True)],
)
def test_a_robot_named_for_two_supervisors_stops_the_start(
    only: set[str], host: str, starts: bool, programs: FakePrograms, robot: Robot, other_robot: Robot
) -> None:
    """Without names, only what another supervisor has is left out."""
    fleet = Fleet(frozenset(only), programs.script, QUIET, host=host)
    Taken(fleet).elsewhere[other_robot.id] = "computer-2, process 7"
    with nullcontext() if starts else pytest.raises(AlreadySupervised, match="computer-2"):
        fleet.claim()


def test_a_console_that_was_taken_over_ends(supervised: Supervised) -> None:
    taken = Taken(supervised.fleet)
    supervised.until_started("tiago-1", 1)
    taken.elsewhere[CONSOLE] = "computer-2, process 7"
    with pytest.raises(AlreadySupervised, match="computer-2"):
        supervised.until(lambda: False, "never")
