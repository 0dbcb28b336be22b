"""A console with two web processes, PostgreSQL and Redis."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from script.stack.processes import Child, ReservedPort
from script.stack.stack import PRACTICE_ROBOTS, Stack, daphne
from tests.processes import until
from tests.script.servers import Postgresql, Redis, running_postgresql
from tests.script.support import listens

READY_S = 120.0


@dataclass
class House:
    """A running console with its servers. `stack.web` is the first web process."""

    stack: Stack
    postgresql: Postgresql
    redis: Redis
    second: Child
    second_port: int

    def said(self, words: str) -> bool:
        """Return whether a web process logged these words."""
        return any(words in (self.stack.logs / f"{name}.log").read_text() for name in ("web", "web-2"))


@contextmanager
def running_house(directory: Path) -> Iterator[House]:
    """Run a console with one robot; its files are in `directory`."""
    port = ReservedPort()
    with running_postgresql() as postgresql, tempfile.TemporaryDirectory(prefix="fleet-redis-") as short:
        redis = Redis(Path(short))
        settings = {"FLEET_DATABASE_URL": postgresql.url, "FLEET_REDIS_URL": redis.url}
        try:
            with Stack(directory / "var", robots=PRACTICE_ROBOTS[:1], settings=settings) as stack:
                where = ["--bind", port.host, "--port", str(port.number)]
                second = stack.start_child("web-2", [*daphne(), *where], stack.environment)
                until(lambda: listens(port.number), "the second web process listens", READY_S)
                yield House(stack, postgresql, redis, second, port.number)
        finally:
            redis.kill()
            port.close()
