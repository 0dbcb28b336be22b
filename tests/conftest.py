"""The standing cast: people by their role on one robot, and the robots.

    staff       everything, on every robot
    supervisor  of `robot`
    operator    of `robot`
    observer    of `robot`
    stranger    signed in like the others, with no role on any robot

Transactional tests find the database as migrations leave it: `tests.pristine` makes it anew after each of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from types import ModuleType

import hypothesis
import pytest
from django.contrib.sessions.models import Session
from django.db import connection
from django.test import Client, TransactionTestCase
from pytest_django import DjangoDbBlocker

from fleet.accounts.models import User
from robots.registry.models import Robot, RobotProfile, RobotRole, Role
from teleop.background.database import in_database_background
from teleop.recording import refusals
from teleop.recording.repeat_suppression import E, RepeatSuppressor
from teleop.stop import emergency_stop
from tests.disk import Disk
from tests.pristine import pristine_copy

# The same examples in every run: what turns red does so because of a change. HYPOTHESIS_PROFILE=search looks further.
# How long an example takes says how busy the machine is.
UNTIMED = hypothesis.settings(deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.register_profile("steady", UNTIMED, derandomize=True)
hypothesis.settings.register_profile("search", UNTIMED)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))

PASSWORD = "a long walk on the beach"


@pytest.fixture(scope="session")
def django_db_setup(django_db_setup: None, django_db_blocker: DjangoDbBlocker) -> Iterator[None]:
    """The test database, which transactional tests find as it was made (`tests.pristine`)."""
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
    """Channels' test communicators leave connections open in their threads; PostgreSQL drops no database in use."""
    with connection.cursor() as cursor:
        cursor.execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
            " WHERE datname = current_database() AND pid <> pg_backend_pid()"
        )


@pytest.fixture
def disk(transactional_db: None) -> Iterator[Disk]:
    """The disk of the database; `disk.fill()` fills it."""
    if connection.vendor != "sqlite":
        pytest.skip("limits the database file")
    disk = Disk()
    yield disk
    disk.free()


@pytest.fixture(autouse=True)
def refusal_log(monkeypatch: pytest.MonkeyPatch) -> Iterator[RepeatSuppressor[refusals.RefusedRequest]]:
    """What is refused in a test is written in it or not at all."""
    own = RepeatSuppressor(refusals.write_record)
    yield from _while_test_lasts(own, refusals, monkeypatch)


@pytest.fixture(autouse=True)
def press_log(monkeypatch: pytest.MonkeyPatch) -> Iterator[RepeatSuppressor[emergency_stop.Press]]:
    """Stops that are pressed in a test are written in it or not at all: the next test would wait for the database."""
    own = RepeatSuppressor(emergency_stop.write_record, most=None)
    yield from _while_test_lasts(own, emergency_stop, monkeypatch)
    in_database_background(lambda: None).result(
        10
    )  # their results too must not be written during the next test


def _while_test_lasts(
    own: RepeatSuppressor[E], module: ModuleType, patch: pytest.MonkeyPatch
) -> Iterator[RepeatSuppressor[E]]:
    patch.setattr(module, "log", own)
    yield own
    patch.setattr(own, "_write", lambda _event, _times: None)
    own.flush()


# --- robots -----------------------------------------------------------------------------------


@pytest.fixture
def tiago(db: None) -> RobotProfile:
    """The profile that the console ships."""
    return RobotProfile.objects.get(slug="tiago")


@pytest.fixture
def robot(tiago: RobotProfile) -> Robot:
    """The robot on which the cast has its roles. Its master does not exist."""
    return Robot.objects.create(
        slug="tiago-1", name="TIAGo 1", profile=tiago, master_uri="http://127.0.0.1:9"
    )


@pytest.fixture
def other_robot(tiago: RobotProfile) -> Robot:
    """A robot on which nobody but staff has a role."""
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
    """`signed_in(operator)`: that person's browser."""

    def sign_in(person: User) -> Client:
        client = Client()
        client.force_login(person)
        return client

    return sign_in


@pytest.fixture
def websocket_headers() -> Callable[[Client], list[tuple[bytes, bytes]]]:
    """`websocket_headers(client)`: what that browser sends when a page of ours opens a WebSocket."""

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
    """`end_session(client)`: what happens to a browser's session when its sign-in is ended elsewhere."""

    def end(client: Client) -> None:
        Session.objects.filter(pk=client.session.session_key).delete()

    return end
