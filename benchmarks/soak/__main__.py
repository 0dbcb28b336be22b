"""script/soak: parts of a running console are killed at random while somebody drives.

motion: no robot may move while nobody holds the stick. Every round: drive, kill one or two parts with kill -9, check
that the base comes to a standstill, start the parts that do not start themselves, let TCP deliver its buffers, and
check that the base still stands.

audit: every message that reaches the robot must have a record. Every round: drive, speak, move, publish, choose, stop;
kill one or two of web process, bridge, records process and database with kill -9; start again; compare the robot's
messages with the log. Half of the rounds use SQLite and half PostgreSQL, if it is installed.

recordings: every file of a recording must open. Every round: drive, record, kill one or two processes with kill -9,
wait until the cut file is finished, and read all files.

attacks: floods from a robot's network and at the web port while somebody drives; see `benchmarks.attacks`.
They run only by name.

motion, audit and recordings end at the first round that breaks a rule; the printed seed repeats the same rounds.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import signal
import sys
import time
from collections import Counter

from benchmarks.attacks.catalogue import ATTACKS
from benchmarks.attacks.run import soak_attacks
from benchmarks.driving.stop import ROBOT, STILL_RADPS, Scene, bridges, scene_on
from benchmarks.harness import progress
from benchmarks.soak import recordings
from benchmarks.soak.killed import PARTS as WRITERS
from benchmarks.soak.killed import Database, Embedded, LostError, Person, Rounds, Witness
from benchmarks.soak.recordings import UnreadableError
from script.stack.client import sign_in
from script.stack.processes import Ended, ended_by_signals
from script.stack.stack import PRACTICE_ROBOTS, Stack, StartError, temporary_stack
from tests.script.servers import Postgresql, postgresql_installed, running_postgresql

STANDSTILL_S = 1.0  # from the kill; includes the controller's own time-out and braking
SETTLED_S = 2.0
READY_S = 90.0  # a fleet supervisor whose restart budget is used up pauses for a minute
ROUNDS = {"motion": 100, "audit": 50, "recordings": 20}
PARTS = ("web", "bridge", "supervisor", "master")


class RuleBrokenError(AssertionError):
    """The robot broke a rule."""


def main() -> int:
    """Return the exit status."""
    parser = argparse.ArgumentParser(
        prog="script/soak",
        description="Kill parts at random: nothing may move unheld, nothing may be missing in the audit log, and every "
        "recording must open.",
    )
    parser.add_argument("what", nargs="?", choices=[*ROUNDS, "attacks"], help="only this one")
    parser.add_argument(
        "--rounds", type=int, help="of each; else 100 of motion, 50 of audit, 20 of recordings"
    )
    parser.add_argument("--seed", type=int, default=int(time.time()))
    attacks = parser.add_argument_group("attacks")
    attacks.add_argument(
        "--only", nargs="+", metavar="NAME", default=[], choices=[one.name for one in ATTACKS]
    )
    attacks.add_argument("--list", action="store_true", help="the attacks by name, and nothing more")
    attacks.add_argument("--short", action="store_true", help="fewer presses: some four minutes")
    attacks.add_argument("--json", action="store_true", help="JSON alone on stdout")
    asked = parser.parse_args()
    if asked.list:
        for one in ATTACKS:
            print(f"{one.name:<16} {one.words}")
        return 0
    soaks = {"motion": soak, "audit": soak_audit, "recordings": soak_recordings}
    try:
        with ended_by_signals():
            if asked.what == "attacks":
                held = soak_attacks(asked.only, asked.seed, short=asked.short, as_json=asked.json)
                return 0 if held else 1
            for what in [asked.what] if asked.what else ROUNDS:
                soaks[what](asked.rounds or ROUNDS[what], asked.seed)
    except Ended as ended:
        progress(f"Ended by {ended}.")
        return 130
    except (RuleBrokenError, LostError, UnreadableError, StartError, TimeoutError) as error:
        print(f"soak: {error}", file=sys.stderr)
        return 1
    return 0


def soak(rounds: int, seed: int) -> None:
    """Run all rounds of *motion* on one console."""
    chance = random.Random(seed)  # noqa: S311 - which part dies
    with temporary_stack(PRACTICE_ROBOTS[:1]) as stack:
        for number in range(1, rounds + 1):
            victims = chance.sample(PARTS, chance.choice((1, 1, 2)))
            progress(f"round {number} of {rounds} (seed {seed}): {' and '.join(victims)}")
            asyncio.run(round_of(stack, victims, chance.uniform(0.0, 1.0)))
    print(f"soak: {rounds} rounds with seed {seed}, nothing moved that should not")


async def round_of(stack: Stack, victims: list[str], pause_s: float) -> None:
    """Run one round."""
    async with scene_on(stack) as scene:
        await scene.moving()
        await asyncio.sleep(pause_s)
        killed_s = time.monotonic()
        for victim in victims:
            kill(stack, scene, victim)
        timing = await scene.timing(killed_s)
        if timing.still_s > STANDSTILL_S:
            raise RuleBrokenError(f"the base stood only after {timing.still_s:.2f} s")
        scene.observer.forget()
        revive(stack, victims)
        await asyncio.to_thread(stack.wait_ready, READY_S)
        await asyncio.sleep(SETTLED_S)
        fastest = max((abs(seen.w) + abs(seen.vx) for seen in scene.observer.odometry), default=0.0)
        if fastest > STILL_RADPS:
            raise RuleBrokenError(f"the base moved ({fastest:.3f}) though nobody held the stick")


def kill(stack: Stack, scene: Scene, victim: str) -> None:
    """Kill a part with SIGKILL."""
    match victim:
        case "web":
            stack.web.signal(signal.SIGKILL)
        case "supervisor":
            stack.supervisor.signal(signal.SIGKILL)
        case "master":
            scene.robot.master.signal(signal.SIGKILL)
        case "bridge":
            for bridge in bridges(stack):
                os.kill(bridge, signal.SIGKILL)


def revive(stack: Stack, victims: list[str]) -> None:
    """Start the parts that do not start themselves. The robot starts with its master, like a real robot."""
    robot = stack.robots[ROBOT]
    if "master" in victims:
        stack.release(robot.master, robot.simulator)
        robot.start_master()
        robot.start_simulator()
    if "supervisor" in victims:
        stack.release(stack.supervisor)
        stack.start_supervisor()
    if "web" in victims:
        stack.release(stack.web)
        stack.start_web()


def soak_recordings(rounds: int, seed: int) -> None:
    """Run the rounds of *recordings*."""
    files = recordings.soak(rounds, seed)
    print(f"soak: {rounds} rounds with seed {seed}; all {files} files of recordings open")


def soak_audit(rounds: int, seed: int) -> None:
    """Run the rounds of *audit* on one console for each database."""
    on_postgresql = rounds // 2 if postgresql_installed() else 0
    with temporary_stack(PRACTICE_ROBOTS[:1]) as stack:
        reached = asyncio.run(audit_rounds(stack, Embedded(), rounds - on_postgresql, seed, "SQLite"))
    if on_postgresql:
        with (
            running_postgresql() as server,
            temporary_stack(PRACTICE_ROBOTS[:1], settings={"FLEET_DATABASE_URL": server.url}) as stack,
        ):
            database = Server(server)
            reached += asyncio.run(audit_rounds(stack, database, on_postgresql, seed, "PostgreSQL"))
    else:
        progress("PostgreSQL is not installed; all rounds were over SQLite")
    print(
        f"soak: {rounds} rounds with seed {seed}; all messages to the robot were recorded: {in_words(reached)}"
    )


async def audit_rounds(stack: Stack, database: Database, number: int, seed: int, where: str) -> Counter[str]:
    """Run these rounds; return the number of messages to the robot by kind."""
    reached = Counter[str]()
    person = Person(stack, await asyncio.to_thread(sign_in, stack, "operator"), seed)
    async with Witness(stack) as witness:
        rounds = Rounds(stack, database, person, witness)
        for place in range(1, number + 1):
            victims = person.chance.sample(WRITERS, person.chance.choice((1, 1, 2)))
            progress(f"round {place} of {number} ({where}, seed {seed}): {' and '.join(victims)}")
            new = await rounds.one(*victims)
            progress(f"    received and recorded: {in_words(new)}")
            reached += new
    return reached


def in_words(reached: Counter[str]) -> str:
    """Return text such as ``12 drive.start, 1 speech.start``; a drive counts once for each velocity."""
    return ", ".join(f"{number} {kind}" for kind, number in sorted(reached.items())) or "nothing"


class Server:
    """PostgreSQL: its clients survive a kill of the server."""

    writers_too = False

    def __init__(self, postgresql: Postgresql) -> None:
        self._postgresql = postgresql

    def kill(self, _stack: Stack) -> None:
        """kill -9 of the server and of each of its processes."""
        self._postgresql.kill()

    def start(self, _stack: Stack) -> None:
        """Start the server; it recovers by itself."""
        self._postgresql.start()


if __name__ == "__main__":
    sys.exit(main())
