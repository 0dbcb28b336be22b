"""If PostgreSQL hangs or is killed while a person drives, the robot stops and no request is lost."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Iterator
from contextlib import contextmanager

from tests.script.audit.database_away import stands_while
from tests.script.house import House
from tests.script.servers import Postgresql

AWAY_S = 12.0  # longer than a page that is gone may stay away (`lease_checks.GRACE_S`)


def test_a_robot_stands_while_the_server_hangs(house: House) -> None:
    asyncio.run(stands_while(house.stack, hanging(house.postgresql), least_s=AWAY_S))


def test_a_robot_stands_while_the_server_is_dead(house: House) -> None:
    asyncio.run(stands_while(house.stack, dead(house.postgresql), least_s=AWAY_S))


@contextmanager
def hanging(server: Postgresql) -> Iterator[None]:
    """Freeze PostgreSQL: it does not answer and does not refuse connections."""
    server.signal_all(signal.SIGSTOP)
    try:
        yield
    finally:
        server.signal_all(signal.SIGCONT)


@contextmanager
def dead(server: Postgresql) -> Iterator[None]:
    server.kill()
    try:
        yield
    finally:
        server.start()
