"""The whole run: slots with and without an attack in turn, then the table."""

from __future__ import annotations

import asyncio
import gc
import itertools
import json
import math
import sqlite3
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, closing, suppress

from benchmarks.attacks.catalogue import ATTACKS, Attack
from benchmarks.attacks.doors import NAMES, door
from benchmarks.attacks.figures import Limits, Taken, broken, figures, table
from benchmarks.attacks.incidents import INCIDENTS
from benchmarks.attacks.scene import LostError, Scene, scene_on
from benchmarks.driving.drive import BARE_STICKS
from benchmarks.driving.stop import ROBOT, bridges
from benchmarks.harness import Figure, machine, progress, quantile
from benchmarks.parts import process_stats
from benchmarks.parts.priority import LIMIT_OF_UNIT
from script.stack.client import sign_in
from script.stack.processes import Child, end_all
from script.stack.stack import Stack, StartError, temporary_stack

# For each attack: slots, presses in each, and presses in the usual slot before it.
LONG = 2, 10, 2
SHORT = 1, 5, 2
IN_FORCE_S = 1.5  # from an attacker's start until its attack has effect
LONGEST_S = 90.0  # life of an attacker
SAMPLE_S = 0.25
BACK_S = 60.0
# After an attack: wait at most CALM_S, check every CHECK_S, until less than this share of a core is busy.
CALM_S, CHECK_S, BUSY = 15.0, 0.5, 0.6

Row = tuple[str, Sequence[Figure], Sequence[str]]


def soak_attacks(only: Sequence[str], seed: int, *, short: bool, as_json: bool) -> bool:
    """Run the attacks on one console and print the table; return True if every limit holds."""
    attacks = [attack for attack in ATTACKS if not only or attack.name in only]
    facts = machine()
    with temporary_stack(BARE_STICKS[:1], settings=LIMIT_OF_UNIT) as stack:
        taken, usual = asyncio.run(run_on(stack, attacks, seed, short=short))
    rows = [_row(attack, taken[attack.name], usual) for attack in attacks if attack.name in taken]
    own: Row = ("as usual", figures(usual, usual, Limits()), [])
    if as_json:
        print(json.dumps(_as_json(facts, seed, [own, *rows])))
    else:
        print(", ".join(f"{key} {value}" for key, value in facts.items()) + f", seed {seed}")
        print(table([own, *rows]))
        for name, _, faults in rows:
            for fault in faults:
                print(f"{name}: {fault}")
    return not any(faults for _, _, faults in rows)


def _row(attack: Attack, taken: Taken, usual: Taken) -> Row:
    measured = figures(taken, usual, attack.limits)
    return attack.name, measured, broken(measured, taken)


def _as_json(facts: dict[str, str | int], seed: int, rows: Sequence[Row]) -> dict[str, object]:
    return {
        "soak": "attacks",
        "machine": facts,
        "seed": seed,
        "attacks": [
            {
                "name": name,
                "figures": [figure.as_json() for figure in measured],
                "broken": list(faults),
            }
            for name, measured, faults in rows
        ],
        "holds": not any(faults for _, _, faults in rows),
    }


async def run_on(
    stack: Stack, attacks: Sequence[Attack], seed: int, *, short: bool
) -> tuple[dict[str, Taken], Taken]:
    """Return the measurements by attack, and those of the usual slots."""
    gc.freeze()
    slots, presses, usual_presses = SHORT if short else LONG
    cookies = {
        role: await asyncio.to_thread(sign_in, stack, role) for role in ("supervisor", "operator", "observer")
    }
    navigation = _start(stack, "ros", "navigate", 3600.0)
    stack.children.append(navigation)  # it ends with the stack
    taken: dict[str, Taken] = {}
    usual = Taken()
    crowd = await asyncio.to_thread(_crowd, stack)
    token = json.loads(crowd)["presser"][0]["token"]
    async with scene_on(stack, cookies["supervisor"], cookies["operator"], token, seed) as scene:
        await _slot(scene, Taken(), ["page", "REST"], calm=True)  # not counted: the first presses are slower
        bench = Bench(scene, cookies, crowd)
        for attack in attacks:
            whole = taken[attack.name] = Taken()
            doors = map(door, itertools.count())
            for _ in range(slots):
                usual.add(await bench.usual(usual_presses, attack.quick // 2))
                whole.add(await bench.attacked(attack, list(itertools.islice(doors, presses))))
                if whole.fault:
                    break
            progress(f"{attack.name}: {_in_words(whole)}")
        usual.add(await bench.usual(usual_presses))
    await asyncio.to_thread(stack.release, navigation)
    return taken, usual


class Bench:
    """Runs one slot after the other."""

    def __init__(self, scene: Scene, cookies: dict[str, str], crowd: str) -> None:
        self._scene = scene
        self._stack = scene.stack
        self._cookies = cookies
        self._crowd = crowd
        self._usual_doors = map(door, itertools.count())

    async def usual(self, presses: int, quick: int = 0) -> Taken:
        """Measure a slot without an attack."""
        taken = Taken()
        try:
            await self._measured(taken, list(itertools.islice(self._usual_doors, presses)), quick, calm=True)
        except LostError as error:
            progress(f"    as usual: {error}; supervisor and web process start again")
            await self._start_again()
        return taken

    async def attacked(self, attack: Attack, doors: Sequence[str]) -> Taken:
        """Press the stop at these doors, for one slot."""
        taken = Taken()
        if attack.side == "incident":
            return await self._struck(attack, taken, len(doors))
        signed_in = {"ATTACK_COOKIE": self._cookies.get(attack.as_who, ""), "ATTACK_CROWD": self._crowd}
        child = _start(self._stack, attack.side, attack.name, LONGEST_S, signed_in)
        try:
            await asyncio.sleep(IN_FORCE_S)
            if attack.plays:
                with suppress(LostError):
                    await self._scene.play()
            await self._measured(taken, doors, attack.quick, calm=False)
            return taken
        finally:
            await asyncio.to_thread(end_all, [child])
            await self._calm()
            taken.attacker = (child.last_lines().splitlines() or [""])[-1]

    async def _calm(self) -> None:
        """Wait until the after-effects of an attack end: they must not count in a usual slot."""
        end_s = time.monotonic() + CALM_S
        while time.monotonic() < end_s:
            web = self._stack.web.pid
            pids = [web, *process_stats.children(web), *bridges(self._stack)]
            before_s = sum(map(_cpu_s, pids))
            await asyncio.sleep(CHECK_S)
            if sum(map(_cpu_s, pids)) - before_s < BUSY * CHECK_S:
                return

    async def _measured(self, taken: Taken, doors: Sequence[str], quick: int, *, calm: bool) -> None:
        async with _watched(self._stack, taken):
            await _slot(self._scene, taken, doors, quick, calm=calm)
            if self._scene.hopeless:
                taken.fault = "the stop did not reach the robot"

    async def _struck(self, attack: Attack, taken: Taken, presses: int) -> Taken:
        incident = INCIDENTS[attack.name]
        each = len(incident.presses_s)
        async with _watched(self._stack, taken):
            self._scene.begin_slot(calm=False)
            for number in range(math.ceil(presses / each)):
                doors = [NAMES[(number + place) % len(NAMES)] for place in range(each)]
                try:
                    await self._scene.strike(incident, doors)
                except LostError as error:
                    taken.fault = str(error)
                if incident.fresh_supervisor or taken.fault:
                    await self._start_again(web=bool(taken.fault))
                if taken.fault:
                    break
            taken.add(self._scene.end_slot())
        return taken

    async def _start_again(self, *, web: bool = True) -> None:
        await self._scene.leave()
        stack = self._stack
        ended = [stack.supervisor, *([stack.web] if web else [])]
        await asyncio.to_thread(stack.release, *ended)
        stack.start_supervisor()
        if web:
            stack.start_web()
        with suppress(StartError):
            await asyncio.to_thread(stack.wait_ready, BACK_S)


async def _slot(scene: Scene, taken: Taken, doors: Sequence[str], quick: int = 0, *, calm: bool) -> None:
    scene.begin_slot(calm=calm)
    try:
        for number, name in enumerate(doors):
            await scene.press(name, number)
            if scene.hopeless:
                return
        for number in range(quick):
            await scene.press_quickly(NAMES[number % len(NAMES)])
        if calm:
            await scene.ready()  # the next slot begins with control and without a stop
    finally:
        taken.add(scene.end_slot())


@asynccontextmanager
async def _watched(stack: Stack, taken: Taken) -> AsyncIterator[None]:
    """Context: measure memory use and growth of the audit log during a slot."""
    before, began_s = _records(stack), time.monotonic()
    sampling = asyncio.create_task(_sample(stack, taken))
    try:
        yield
    finally:
        sampling.cancel()
        taken.records += _records(stack) - before
        taken.lasted_s += time.monotonic() - began_s


async def _sample(stack: Stack, taken: Taken) -> None:
    while True:
        bridge = _resident_mb(bridges(stack))
        web = _resident_mb([stack.web.pid, *process_stats.children(stack.web.pid)])
        one = Taken(bridge_mb=(bridge, bridge), web_mb=(web, web))
        if bridge and web:
            taken.add(one)
        await asyncio.sleep(SAMPLE_S)


def _resident_mb(pids: Sequence[int]) -> float:
    total = 0.0
    for pid in pids:
        with suppress(OSError):
            total += process_stats.resident_mb(pid)
    return total


def _cpu_s(pid: int) -> float:
    with suppress(OSError):
        return process_stats.cpu_s(pid)
    return 0.0


def _records(stack: Stack) -> int:
    address = f"file:{stack.directory / 'fleet.sqlite3'}?mode=ro"
    with closing(sqlite3.connect(address, uri=True, timeout=10.0)) as database:
        return int(database.execute("SELECT count(*) FROM audit_record").fetchone()[0])


def _crowd(stack: Stack) -> str:
    """Make the people of `benchmarks.attacks.people`; return their keys as JSON."""
    command = [sys.executable, "-m", "benchmarks.attacks.people"]
    made = subprocess.run(command, env=stack.environment, stdout=subprocess.PIPE, check=True)  # noqa: S603
    return made.stdout.decode().splitlines()[-1]


def _start(
    stack: Stack, side: str, role: str, seconds: float, signed_in: Mapping[str, str] | None = None
) -> Child:
    command = [sys.executable, "-m", f"benchmarks.attacks.{side}_side", role, str(seconds)]
    if side == "ros":
        environment = stack.robots[ROBOT].environment
    else:
        command += [stack.hosts[0], str(stack.port), stack.url]
        environment = {**stack.environment, **(signed_in or {})}
    child = stack.start_child(f"attack-{role}-{time.monotonic_ns()}", command, environment)
    stack.children.remove(child)  # the stack must not fail when an attacker ends
    return child


def _in_words(taken: Taken) -> str:
    zeros = [press.zero_s for press in taken.presses]
    by_door = {name: [zero_s for door, zero_s in taken.quick if door == name] for name in NAMES}
    quick = {
        name: f"{1e3 * quantile(found, 0.5):.1f}, {1e3 * quantile(found, 0.9):.1f}, {1e3 * max(found):.1f}"
        for name, found in by_door.items()
        if found
    }
    parts = [
        f"press -> zero worst {1000.0 * max(zeros, default=math.nan):.0f} ms of {len(zeros)}",
        f"gap {1000.0 * max((press.gap_s for press in taken.presses), default=math.nan):.0f} ms",
        f"{taken.lost} of {taken.sent} commands lost",
        f"doors {taken.answers}",
        f"quick presses, p50, p90 and worst in ms {quick}",
    ]
    if taken.halts:
        parts.append(f"halts {taken.halts}")
    if taken.attacker:
        parts.append(f"attacker: {taken.attacker}")
    if taken.fault:
        parts.append(f"FAULT {taken.fault}")
    return "; ".join(parts)
