"""Rounds in which processes are killed (kill -9) while a robot is driven and recorded: every file must open."""

from __future__ import annotations

import asyncio
import os
import random
import signal
import time
from contextlib import suppress
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import SeekingReader, make_reader

from benchmarks.driving.recording import linked, recorders
from benchmarks.driving.stop import bridges, scene_on
from benchmarks.harness import progress
from benchmarks.parts import process_stats
from robots.bridge.recorder.files.directory import FILE, PART
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

PARTS = ("web", "bridge", "supervisor", "records", "recorder", "recorder")
FINISHED_S = 60.0  # by which the next recorder has finished every cut file
LOST_S = 3.0  # at most, until the kill: a second, and a busy computer


class UnreadableError(AssertionError):
    """A recording is lost, or does not open."""


def soak(rounds: int, seed: int) -> int:
    """Run all rounds on one console; return the number of files. Raises UnreadableError."""
    chance = random.Random(seed)  # noqa: S311 - which part dies
    with temporary_stack(PRACTICE_ROBOTS[:1], settings={"FLEET_RECORDINGS": ""}) as stack:
        for number in range(1, rounds + 1):
            victims = sorted(set(chance.sample(PARTS, chance.choice((1, 1, 2)))))
            progress(f"round {number} of {rounds} (seed {seed}): {' and '.join(victims)}")
            asyncio.run(_round(stack, victims, chance.uniform(0.0, 1.5)))
        return len(list(_files(stack)))


async def _round(stack: Stack, victims: list[str], pause_s: float) -> None:
    async with scene_on(stack) as scene:
        await scene.moving()
        async with linked(stack) as link:
            await link.begin("all")
        await asyncio.sleep(pause_s)
        killed = time.time()
        for victim in victims:
            _kill(stack, victim)
        await scene.timing(time.monotonic())  # releases the stick
        _revive(stack, victims)
        await asyncio.to_thread(stack.wait_ready, 90.0)
    async with linked(stack) as again:
        await again.end_all()
    await asyncio.to_thread(_wait_finished, stack, str(link.recording))
    for path in _files(stack):
        _check(path, killed if str(link.recording) in path.name else 0.0)


def _kill(stack: Stack, victim: str) -> None:
    match victim:
        case "web":
            stack.web.signal(signal.SIGKILL)
        case "supervisor":
            stack.supervisor.signal(signal.SIGKILL)
        case _:
            for pid in _processes(stack, victim):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def _processes(stack: Stack, name: str) -> list[int]:
    match name:
        case "bridge":
            return bridges(stack)
        case "recorder":
            return recorders(stack)
        case _:
            children = process_stats.children(stack.supervisor.pid)
            return [child for child in children if "run_records" in process_stats.arguments(child)]


def _revive(stack: Stack, victims: list[str]) -> None:
    if "supervisor" in victims:
        stack.release(stack.supervisor)
        stack.start_supervisor()
    if "web" in victims:
        stack.release(stack.web)
        stack.start_web()


def _wait_finished(stack: Stack, recording: str) -> None:
    """Wait until this round's file is finished, and no other is cut."""
    folder = stack.directory / "recordings"
    until_s = time.monotonic() + FINISHED_S
    while any(folder.glob(f"*{PART}")) or not any(folder.glob(f"*{recording}{FILE}")):
        if time.monotonic() > until_s:
            raise UnreadableError(f"not finished: {sorted(path.name for path in folder.iterdir())}")
        time.sleep(0.2)


def _files(stack: Stack) -> list[Path]:
    return sorted((stack.directory / "recordings").glob(f"*{FILE}"))


def _check(path: Path, killed: float) -> None:
    """Read a whole file. Raises UnreadableError."""
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            if not isinstance(reader, SeekingReader):
                raise UnreadableError(f"{path.name} cannot be read")
            last_ns = max(message.log_time for _, _, message in reader.iter_messages())
    except (McapError, ValueError) as error:
        raise UnreadableError(f"{path.name} does not open: {error}") from error
    if killed - last_ns / 1e9 > LOST_S:
        raise UnreadableError(f"{path.name} ends {killed - last_ns / 1e9:.1f} s before the kill")
