"""A kill of web process, bridge, records process or database in a session loses no request that reached the robot."""

from __future__ import annotations

import asyncio
import sqlite3
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from benchmarks.soak.killed import Embedded, Person, Rounds, Witness
from script.stack.client import sign_in
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack
from tests.script.audit.database_away import stands_while

ROUNDS = [("web",), ("bridge",), ("database",), ("web", "bridge"), ("records",)]
KINDS = {"drive.start", "speech.start", "motion.start", "publish.start"}


@pytest.fixture(scope="module")
def stack() -> Iterator[Stack]:
    with temporary_stack(PRACTICE_ROBOTS[:1]) as stack:
        yield stack


def test_random_kills_lose_no_request_that_reached_the_robot(stack: Stack) -> None:
    seed = int(time.time())
    print(f"seed {seed}")
    reached = asyncio.run(rounds(stack, seed))
    assert reached.keys() >= KINDS, "the rounds tried too little"


async def rounds(stack: Stack, seed: int) -> Counter[str]:
    person = Person(stack, sign_in(stack, "operator"), seed)
    reached = Counter[str]()
    async with Witness(stack) as witness:
        tried = Rounds(stack, Embedded(), person, witness)
        # The moments are random: repeat the rounds if one kind of request never reached the robot.
        for number, victims in enumerate([*person.chance.sample(ROUNDS, len(ROUNDS)), *ROUNDS]):
            if number >= len(ROUNDS) and reached.keys() >= KINDS:
                break
            began_s = time.monotonic()
            counts = await tried.one(*victims)
            print(f"{' and '.join(victims)}: {dict(counts)} in {time.monotonic() - began_s:.1f} s")
            reached.update(counts)
    return reached


def test_a_robot_stands_while_the_database_is_locked(stack: Stack) -> None:
    asyncio.run(stands_while(stack, locked(stack.directory / "fleet.sqlite3")))


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the database's write lock."""
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield
