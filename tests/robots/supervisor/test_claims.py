"""Claims of robots in PostgreSQL; on SQLite one supervisor locks the database's file."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from django.db import OperationalError, connection

from robots.shared.processes.one_supervisor import AlreadySupervised
from robots.supervisor.claims import CONSOLE, Claims, sole_supervisor
from tests.processes import until

ONE, TWO = uuid4(), uuid4()


class OtherComputer:
    """A supervisor with a session of its own."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)  # a thread has its own connection
        self._claims = Claims("computer-2")

    def take(self, *robots: object) -> dict[object, str]:
        return self._thread.submit(self._claims.take, robots).result()

    def break_sessions(self) -> None:
        """End all other sessions with the database."""
        self._thread.submit(_end_others).result()

    def end_session(self) -> None:
        self._thread.submit(lambda: connection.close()).result()  # its own connection

    def end(self) -> None:
        self.end_session()
        self._thread.shutdown()


def _end_others() -> None:
    with connection.cursor() as cursor:
        cursor.execute(
            "SELECT pg_terminate_backend(pid, 5000) FROM pg_stat_activity"
            " WHERE datname = current_database() AND pid <> pg_backend_pid()"
        )


@pytest.fixture
def other() -> Iterator[OtherComputer]:
    other = OtherComputer()
    yield other
    other.end()
    connection.close()


postgresql = pytest.mark.skipif(connection.vendor != "postgresql", reason="these are locks of PostgreSQL")


@postgresql
@pytest.mark.django_db(transaction=True)
def test_a_claimed_robot_is_refused_naming_the_computer(other: OtherComputer) -> None:
    claims = Claims("computer-1")
    assert claims.take([CONSOLE, ONE]) == {}
    assert claims.take([ONE]) == {}
    refused = other.take(ONE, TWO)
    assert list(refused) == [ONE] and refused[ONE].startswith("computer-1, process ")
    assert claims.take([CONSOLE, ONE, TWO]).keys() == {TWO}
    claims.keep([CONSOLE])
    assert other.take(ONE) == {}


@postgresql
@pytest.mark.django_db(transaction=True)
def test_claims_come_again_after_a_break_unless_taken(other: OtherComputer) -> None:
    claims = Claims("computer-1")
    assert claims.take([ONE, TWO]) == {}
    other.break_sessions()
    with pytest.raises(OperationalError), connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    connection.close()  # as the supervisor does after an error
    assert other.take(TWO) == {}
    assert claims.take([ONE, TWO]).keys() == {TWO}
    assert other.take(ONE).keys() == {ONE}


@postgresql
@pytest.mark.django_db(transaction=True)
def test_a_session_that_the_server_still_has_is_no_other() -> None:
    """After a broken network, the server may notice late that the old session is gone."""
    claims = Claims()
    assert claims.take([ONE]) == {}
    old, connection.connection = connection.connection, None
    assert claims.take([ONE]) == {}
    assert not claims._held
    old.close()
    until(lambda: claims.take([ONE]) == {} and claims._held, "the claim")


@postgresql
@pytest.mark.django_db(transaction=True)
def test_the_name_of_another_supervisor_may_be_the_same(other: OtherComputer) -> None:
    """Containers with the computer's network have its name, and their processes the same numbers."""
    claims = Claims("computer-2")  # in the same process
    assert other.take(ONE) == {}
    assert claims.take([ONE]).keys() == {ONE}


@pytest.mark.skipif(connection.vendor != "sqlite", reason="locks the database's file")
def test_two_run_directories_do_not_share_a_database(tmp_path: Path, settings: Any) -> None:
    settings.FLEET_RUN_DIR = tmp_path
    before = connection.settings_dict["NAME"]
    connection.settings_dict["NAME"] = str(tmp_path / "fleet.sqlite3")
    try:
        with sole_supervisor():
            settings.FLEET_RUN_DIR = tmp_path / "other"
            settings.FLEET_RUN_DIR.mkdir()
            with pytest.raises(AlreadySupervised, match="this computer, process"), sole_supervisor():
                pass
    finally:
        connection.settings_dict["NAME"] = before
