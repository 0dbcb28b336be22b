"""Fixtures for all tests: robots, and one person for each role.

    staff       all rights on every robot
    supervisor  role on `robot`
    operator    role on `robot`
    observer    role on `robot`
    stranger    has an account, but no role on any robot

Each transactional test starts with the freshly migrated database: `tests.pristine` restores it.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from django.contrib.sessions.models import Session
from django.db import connection
from django.test import Client, TransactionTestCase
from pytest_django import DjangoDbBlocker

from fleet.accounts.models import User
from robots.registry.models import Robot, RobotProfile, RobotRole, Role
from script.stack.database import new_database
from teleop.records import refusals
from teleop.records.repeat_suppression import E, RepeatSuppressor
from teleop.stop import emergency_stop
from tests.full_disk import Disk
from tests.late_calls import LateCalls
from tests.pristine import pristine_copy

pytest_plugins = ["tests.selection"]

PASSWORD = "a long walk on the beach"
WEB_PROCESS = "tests/fleet/server/"
LONG_FILES = (
    "fleet/server/stops/test_floods.py",
    "fleet/test_no_faults.py",
    "api/test_matrix.py",
    "control/test_control.py",
    "teleop/test_access_matrix.py",
    "reports/test_housekeeping.py",
    "fleet/test_migration.py",
    "control/test_rights.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run long files first, so that no worker runs one alone at the end."""
    items.sort(key=lambda item: not item.path.as_posix().endswith(LONG_FILES))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `--dist loadfile`, let one worker run all tests that share the web process of `tests/fleet/server`.

    `--dist loadgroup` does not: xdist 3.8 appends the group to a private name that pytest 9.2 does not have, and so
    spreads a group over all workers.
    """
    from xdist.scheduler import LoadFileScheduling

    class ByWebProcess(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return WEB_PROCESS if nodeid.startswith(WEB_PROCESS) else super()._split_scope(nodeid)

    return ByWebProcess(config, log) if config.getoption("dist") == "loadfile" else None


def pytest_collection_finish() -> None:
    """Exclude collected tests and loaded code from garbage collection: each full run would check them all."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown() -> None:
    """Wait for letters that a test sent on a thread: they use its database."""
    for thread in threading.enumerate():
        if thread.name == "email":
            thread.join(1.0)


@pytest.fixture(scope="session")
def django_db_keepdb() -> bool:
    """On SQLite, tests begin with a copy of a migrated database: a migration would take each worker 4 s."""
    return connection.vendor == "sqlite"


@pytest.fixture(scope="session")
def django_db_modify_db_settings(django_db_modify_db_settings: None, django_db_keepdb: bool) -> None:
    """Copy the migrated database to the path of this worker's test database."""
    if django_db_keepdb:
        new_database(Path(connection.settings_dict["TEST"]["NAME"]))


@pytest.fixture(scope="session")
def django_db_setup(django_db_setup: None, django_db_blocker: DjangoDbBlocker) -> Iterator[None]:
    """The test database. It is restored after each transactional test (`tests.pristine`)."""
    with django_db_blocker.unblock():
        copy = pristine_copy()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TransactionTestCase, "_fixture_teardown", lambda _case: copy.restore())
        yield
    with django_db_blocker.unblock():
        copy.forget()
        if connection.vendor == "postgresql":
            _end_other_connections()


def _end_other_connections() -> None:
    """End connections that Channels' test communicators left open: PostgreSQL drops no database in use."""
    with connection.cursor() as cursor:
        cursor.execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
            " WHERE datname = current_database() AND pid <> pg_backend_pid()"
        )


@pytest.fixture
def disk(transactional_db: None) -> Iterator[Disk]:
    """`disk.fill()` fills the disk of the database."""
    if connection.vendor != "sqlite":
        pytest.skip("limits the database file")
    disk = Disk()
    yield disk
    disk.free()


@pytest.fixture(autouse=True)
def late_records(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test with a database has its own logs of refusals and stop presses, which write before it ends, or not at all.

    A late write would delay the next test, or be in its database: other threads end their calls first, too. Without
    `transactional_db`, no refusal is written: the writing thread would wait for the test's open transaction until the
    write fails.
    """
    marker = request.node.get_closest_marker("django_db")
    commits = "transactional_db" in request.fixturenames or bool(marker and marker.kwargs.get("transaction"))
    if not (commits or marker or "db" in request.fixturenames):
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        calls, writes = LateCalls(patch), Writes()
        refused = RepeatSuppressor(writes.until_the_end(refusals.write_record if commits else _nothing))
        pressed = RepeatSuppressor(writes.until_the_end(emergency_stop.write_record), most=None)
        patch.setattr(refusals, "refusal_records", refused)
        patch.setattr(emergency_stop, "press_records", pressed)
        yield
        calls.end()
        writes.ended = True
        refused.flush()
        pressed.flush()
        calls.end()  # the results of stop presses


class Writes:
    """Writes records until the test ends; later ones are dropped."""

    ended = False

    def until_the_end(self, write: Callable[[E, int], None]) -> Callable[[E, int], None]:
        return lambda event, times: None if self.ended else write(event, times)


def _nothing(_event: object, _times: int) -> None:
    pass


# --- robots -----------------------------------------------------------------------------------


@pytest.fixture
def tiago(db: None) -> RobotProfile:
    """The shipped TIAGo profile."""
    return RobotProfile.objects.get(slug="tiago")


@pytest.fixture
def robot(tiago: RobotProfile) -> Robot:
    """The robot on which these people have their roles. Its master does not exist."""
    return Robot.objects.create(
        slug="tiago-1", name="TIAGo 1", profile=tiago, master_uri="http://127.0.0.1:9"
    )


@pytest.fixture
def other_robot(tiago: RobotProfile) -> Robot:
    """A robot on which only staff has rights."""
    return Robot.objects.create(
        slug="tiago-2", name="TIAGo 2", profile=tiago, master_uri="http://127.0.0.1:9"
    )


# --- people -----------------------------------------------------------------------------------


@pytest.fixture
def staff(db: None) -> User:
    return User.objects.create_user("staff", password=PASSWORD, full_name="Sam Staff", is_staff=True)


@pytest.fixture
def supervisor(robot: Robot) -> User:
    return _person_with("supervisor", "Sue Pervisor", robot, Role.SUPERVISOR)


@pytest.fixture
def operator(robot: Robot) -> User:
    return _person_with("operator", "Olga Operator", robot, Role.OPERATOR)


@pytest.fixture
def second_operator(robot: Robot) -> User:
    return _person_with("second", "Olaf Operator", robot, Role.OPERATOR)


@pytest.fixture
def observer(robot: Robot) -> User:
    return _person_with("observer", "Obi Observer", robot, Role.OBSERVER)


@pytest.fixture
def stranger(db: None) -> User:
    return User.objects.create_user("stranger", password=PASSWORD, full_name="Stig Stranger")


def _person_with(username: str, full_name: str, robot: Robot, role: Role) -> User:
    person = User.objects.create_user(username, password=PASSWORD, full_name=full_name)
    RobotRole.objects.create(robot=robot, user=person, role=role.value)
    return person


# --- signed in --------------------------------------------------------------------------------


@pytest.fixture
def signed_in() -> Callable[[User], Client]:
    """`signed_in(operator)`: return that person's signed-in browser."""

    def sign_in(person: User) -> Client:
        client = Client()
        client.force_login(person)
        return client

    return sign_in


@pytest.fixture
def websocket_headers() -> Callable[[Client], list[tuple[bytes, bytes]]]:
    """`websocket_headers(client)`: the headers with which that browser opens a WebSocket from a page of the console."""

    def headers(client: Client) -> list[tuple[bytes, bytes]]:
        cookie = "; ".join(f"{name}={morsel.value}" for name, morsel in client.cookies.items())
        return [
            (b"host", b"testserver"),
            (b"origin", b"http://testserver"),
            (b"cookie", cookie.encode()),
        ]

    return headers


@pytest.fixture
def end_session() -> Callable[[Client], None]:
    """`end_session(client)`: end a browser's session, as if its sign-in was ended elsewhere."""

    def end(client: Client) -> None:
        Session.objects.filter(pk=client.session.session_key).delete()

    return end
