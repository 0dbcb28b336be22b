"""Writers of SQLite wait in turns: none is passed by newcomers until its time is over."""

import threading
import time

import pytest
from django.db import OperationalError, connection, transaction

from fleet.base.database.sqlite import base

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture(autouse=True)
def _sqlite_only():
    if connection.vendor != "sqlite":
        pytest.skip("PostgreSQL locks rows")


def test_no_writer_is_passed_by_many():
    passed, begun, until = [], [0], time.monotonic() + 1.5

    def write():
        while time.monotonic() < until:
            before = begun[0]
            with transaction.atomic():
                passed.append(begun[0] - before)
                begun[0] += 1
                time.sleep(0.01)
        connection.close()

    threads = [threading.Thread(target=write) for _ in range(10)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert max(passed) < 30  # fair: the other nine


def test_who_waits_too_long_for_the_turn_is_told(monkeypatch):
    monkeypatch.setitem(connection.settings_dict["OPTIONS"], "timeout", 0.05)
    with base._turn, pytest.raises(OperationalError, match="database is locked"), transaction.atomic():
        pass
    with transaction.atomic():
        pass
