"""script/soak: parts of a running console are killed at random while somebody drives; nothing may move unheld.

Every round: drive, kill one or two parts with kill -9, watch the base come to a standstill, start again what does not
start itself, let TCP deliver what it still holds, and see that the base still stands. It ends at the first round
that breaks a rule; the seed that was printed makes the same rounds again.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import signal
import sys
import time

from benchmarks.harness import progress
from benchmarks.stop import ROBOT, STILL_RADPS, Scene, bridges, scene_on
from script.stack.demo import Ended, ended_by_signals
from script.stack.stack import PRACTICE_ROBOTS, Stack, StartError, temporary_stack

STANDSTILL_S = 1.0  # from the kill; the controller's own time-out and braking are in it
SETTLED_S = 2.0
READY_S = 90.0  # a supervisor whose restart budget is spent rests for a minute
PARTS = ("web", "bridge", "supervisor", "master")


class RuleBrokenError(AssertionError):
    """The robot did what it must not."""


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="script/soak", description="Kill parts at random; nothing may move unheld."
    )
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    asked = parser.parse_args()
    try:
        with ended_by_signals():
            soak(asked.rounds, asked.seed)
    except Ended:
        return 130
    except (RuleBrokenError, StartError, TimeoutError) as error:
        print(f"soak: {error}", file=sys.stderr)
        return 1
    return 0


def soak(rounds: int, seed: int) -> None:
    """Run them all on one console."""
    chance = random.Random(seed)  # noqa: S311 - which part dies
    with temporary_stack(PRACTICE_ROBOTS[:1]) as stack:
        for number in range(1, rounds + 1):
            victims = chance.sample(PARTS, chance.choice((1, 1, 2)))
            progress(f"round {number} of {rounds} (seed {seed}): {' and '.join(victims)}")
            asyncio.run(round_of(stack, victims, chance.uniform(0.0, 1.0)))
    print(f"soak: {rounds} rounds with seed {seed}, nothing moved that should not")


async def round_of(stack: Stack, victims: list[str], pause_s: float) -> None:
    """One round."""
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
    """kill -9."""
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
    """Start again what does not start itself. The robot starts with its master, as a real one does."""
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


if __name__ == "__main__":
    sys.exit(main())
