"""``manage.py stop`` stops all robots in parallel and names the robots that it did not reach."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from io import StringIO
from pathlib import Path
from unittest import mock

import pytest
from django.conf import settings
from django.core.management import CommandError, call_command
from django.db import OperationalError
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, unix_serve

from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.site.management.commands import stop
from robots.bridge.link_handler import OTHER_ROBOT
from robots.link import stop_courier as courier
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared import wire
from tests.processes import PATIENCE_S

pytestmark = pytest.mark.django_db(transaction=True)  # another thread reads the registry


class Bridge:
    """A fake bridge: sends its robot's name, stores stops and answers them."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.stops: list[wire.LinkStop] = []
        self.stopped = threading.Event()

    def serve(self, connection: ServerConnection) -> None:
        hello = {
            "t": "bridge_hello",
            "protocol": wire.PROTOCOL,
            "robot": str(self.robot.id),
            "slug": self.robot.slug,
        }
        connection.send(json.dumps(hello))
        with suppress(ConnectionClosed):
            for raw in connection:
                self.hear(connection, wire.link_request(raw))

    def hear(self, connection: ServerConnection, message: wire.LinkRequest) -> None:
        if not isinstance(message, wire.LinkStop):
            return
        if message.robot not in (None, self.robot.id):
            connection.send(wire.encode(wire.Refused("link_stop", OTHER_ROBOT, message.seq)), text=True)
            return
        self.stops.append(message)
        self.stopped.set()
        stop = wire.StopState("stopping", by=message.by, reason=message.reason)
        connection.send(wire.encode(wire.Stopped(stop, message.seq, message.press)), text=True)


def path_of(robot: Robot) -> Path:
    path = link_address(robot).unix_path
    assert path is not None
    return Path(path)


@pytest.fixture(autouse=True)
def run_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for bridge sockets."""
    monkeypatch.setattr(settings, "FLEET_RUN_DIR", tmp_path)
    return tmp_path


@pytest.fixture
def bridge() -> Iterator[Callable[[Robot], Bridge]]:
    """`bridge(robot)`: start a fake bridge at the robot's link address."""
    with ExitStack() as closing:

        def start(robot: Robot) -> Bridge:
            bridge = Bridge(robot)
            path = path_of(robot)
            server = unix_serve(bridge.serve, str(path))
            closing.callback(path.unlink)
            closing.callback(server.shutdown)
            threading.Thread(target=server.serve_forever, daemon=True).start()
            return bridge

        yield start


def test_all_robots_are_stopped_with_person_and_reason(
    robot: Robot, other_robot: Robot, bridge: Callable[[Robot], Bridge]
) -> None:
    bridges = [bridge(robot), bridge(other_robot)]
    out = StringIO()
    call_command("stop", "--all", "--reason", "smoke in the lab", stdout=out)
    assert out.getvalue().splitlines() == ["tiago-1: stopping", "tiago-2: stopping"]
    for stopped in bridges:
        (pressed,) = stopped.stops
        assert pressed.by.endswith("(command line)") and pressed.reason == "smoke in the lab"
    records = Record.objects.filter(kind="stop.press").order_by("id")
    assert [record.robot_name for record in records] == ["TIAGo 1", "TIAGo 1", "TIAGo 2", "TIAGo 2"]
    assert [record.outcome for record in records] == [
        "",
        "stopping",
    ] * 2  # the same records as from a page: press, then outcome
    assert {record.details.get("text") for record in records} == {"smoke in the lab", None}


def test_an_unreached_robot_is_named_and_the_others_stop(
    robot: Robot, other_robot: Robot, bridge: Callable[[Robot], Bridge]
) -> None:
    reached = bridge(other_robot)
    with pytest.raises(CommandError, match=r"Pending, .*: tiago-1\. .* Use the red button"):
        call_command("stop", "--all", stdout=StringIO())
    assert len(reached.stops) == 1
    press, outcome = Record.objects.filter(robot_id=robot.id).order_by("id")
    assert (press.outcome, outcome.of_id) == ("", press.pk)
    assert outcome.outcome == "pending" and outcome.details["words"]


def test_a_named_robot_alone_is_stopped(
    robot: Robot, other_robot: Robot, bridge: Callable[[Robot], Bridge]
) -> None:
    stopped, untouched = bridge(robot), bridge(other_robot)
    call_command("stop", "tiago-1", stdout=StringIO())
    assert len(stopped.stops) == 1
    assert untouched.stops == []


def test_a_wrong_name_stops_the_named_others(robot: Robot, bridge: Callable[[Robot], Bridge]) -> None:
    stopped = bridge(robot)
    with pytest.raises(CommandError, match="There is no robot tiago-9"):
        call_command("stop", "tiago-1", "tiago-9", stdout=StringIO())
    assert len(stopped.stops) == 1


def test_a_stop_that_cannot_be_recorded_is_made_all_the_same(
    robot: Robot, bridge: Callable[[Robot], Bridge], caplog: pytest.LogCaptureFixture
) -> None:
    stopped, errors = bridge(robot), StringIO()
    full = AuditUnavailable("audit_disk_full", "the disk is full")
    with mock.patch("fleet.audit.services.record", autospec=True, side_effect=full):
        call_command("stop", "tiago-1", stdout=StringIO(), stderr=errors)
    assert len(stopped.stops) == 1
    assert "tiago-1: not recorded" in errors.getvalue()
    assert "the disk is full" in caplog.text


@pytest.fixture
def no_database(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every look-up of a robot fail."""

    def away(**_: object) -> None:
        raise OperationalError("connection refused")

    monkeypatch.setattr(Robot.objects, "filter", away)
    monkeypatch.setattr(Robot.objects, "all", away)


def test_without_database_every_local_bridge_is_stopped(
    robot: Robot,
    other_robot: Robot,
    bridge: Callable[[Robot], Bridge],
    no_database: None,
    run_dir: Path,
) -> None:
    (run_dir / "left-over.sock").touch()
    bridges, out = [bridge(robot), bridge(other_robot)], StringIO()
    with pytest.raises(
        CommandError, match=r"database does not answer .*: 2 robots are stopping, 1 did not"
    ) as said:
        call_command("stop", "--all", "--reason", "smoke", stdout=out)
    assert "Nothing was recorded" in str(said.value)
    assert [[stop.reason for stop in stopped.stops] for stopped in bridges] == [["smoke"], ["smoke"]]
    assert out.getvalue().count(": stopping") == 2


def test_without_database_a_restarting_bridge_is_stopped_too(robot: Robot, no_database: None) -> None:
    """The robot's watchdog runs. The stop waits until it can reach the bridge or the watchdog."""
    path_of(robot).with_suffix(".stop").touch()
    with pytest.raises(CommandError, match=r"0 robots are stopping, 1 did not answer; their stop is pending"):
        call_command("stop", "--all", stdout=StringIO())
    (waiting,) = courier.pending_stops().all()
    assert waiting.name == path_of(robot).stem
    courier.pending_stops().settle(waiting, wire.Refusal("over", "The test is over.", "wire"))


def test_without_database_no_robot_is_known_by_name(no_database: None) -> None:
    with pytest.raises(CommandError, match="Use --all"):
        call_command("stop", "tiago-1", stdout=StringIO())


def test_local_robots_are_stopped_before_the_database_answers(
    robot: Robot, bridge: Callable[[Robot], Bridge], monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped = bridge(robot)

    def late(**_: object) -> list[Robot]:
        assert stopped.stopped.wait(PATIENCE_S)
        return [robot]

    monkeypatch.setattr(Robot.objects, "all", late)
    out = StringIO()
    call_command("stop", "--all", stdout=out)
    assert out.getvalue() == "tiago-1: stopping\n"


@pytest.mark.parametrize(("asked", "said"), [("--all", "1 robots are stopping"), ("tiago-1", "Use --all")])
def test_a_database_that_says_nothing_is_as_good_as_none(
    robot: Robot, bridge: Callable[[Robot], Bridge], monkeypatch: pytest.MonkeyPatch, asked: str, said: str
) -> None:
    answers, over = threading.Event(), threading.Event()

    def hang(**_: object) -> list[Robot]:
        answers.wait()
        over.set()
        return []

    monkeypatch.setattr(stop, "REGISTRY_S", 0.05)
    monkeypatch.setattr(Robot.objects, "all", hang)
    monkeypatch.setattr(Robot.objects, "filter", hang)
    bridge(robot)
    try:
        with pytest.raises(CommandError, match=rf"does not answer.*within 0\.05 s.*{said}"):
            call_command("stop", asked, stdout=StringIO())
    finally:
        answers.set()
        assert over.wait(PATIENCE_S)


def test_a_stop_of_a_robot_out_of_service_is_recorded(
    robot: Robot, other_robot: Robot, bridge: Callable[[Robot], Bridge]
) -> None:
    Robot.objects.update(enabled=False)
    path_of(other_robot).touch()  # the file of a bridge that has ended
    bridge(robot)
    out = StringIO()
    call_command("stop", "--all", stdout=out)
    assert out.getvalue() == "tiago-1: stopping\n"
    assert Record.objects.filter(kind="stop.press", robot_id=robot.id, outcome="stopping").exists()


def test_a_stop_is_never_pressed_at_another_robots_bridge(
    robot: Robot, other_robot: Robot, bridge: Callable[[Robot], Bridge]
) -> None:
    untouched, out = bridge(robot), StringIO()
    path_of(other_robot).symlink_to(path_of(robot))  # both robots share one bridge address
    with pytest.raises(CommandError, match=r"Not reached: tiago-2\."):
        call_command("stop", "tiago-2", stdout=out)
    assert "belongs to another robot" in out.getvalue()
    assert untouched.stops == []


@pytest.mark.parametrize("arguments", [[], ["tiago-1", "--all"]])
def test_robots_are_named_or_all_are_meant(arguments: list[str]) -> None:
    with pytest.raises(CommandError, match="Name robots, or use --all"):
        call_command("stop", *arguments)


def test_no_name_and_odd_encodings_prevent_no_stop(robot: Robot, bridge: Callable[[Robot], Bridge]) -> None:
    stopped = bridge(robot)
    with mock.patch("getpass.getuser", side_effect=KeyError("uid not found")):
        call_command("stop", "tiago-1", "--reason", "sm\udcf6ke", stdout=StringIO())
    (pressed,) = stopped.stops
    assert (pressed.by, pressed.reason) == (f"uid {os.getuid()} (command line)", "sm?ke")
