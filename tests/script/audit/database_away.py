"""Checks for tests that drive a robot while the database disappears and returns."""

from __future__ import annotations

import asyncio
import time
from contextlib import AbstractContextManager

from benchmarks.soak.killed import Person, Witness, read_log
from benchmarks.soak.reconciliation import unrecorded
from robots.shared import wire
from script.stack.client import DRIVE_PERIOD_S, Driver, sign_in
from script.stack.stack import Stack

STANDS_S = 3.0  # 2.5 s without the database, and a delay because two cores are busy
NOTICED_S = 10.0
LOOKED_S = 0.5
TURN, TURNING_RADPS = 0.6, 0.1
NOTES, NOTES_HZ = "/fleet_demo/notes", 5.0
# Words of the log about the end of publishing, and with it of the drive's end.
ENDED = {
    "not_recorded": "the robot’s actions could not be recorded",
    "control_ended": "Control was not renewed in time.",
}


async def stands_while(
    stack: Stack, database_away: AbstractContextManager[object], *, least_s: float = 0.0
) -> None:
    """Check that the robot stops with a reason, remains still, and drives again after a neutral stick.

    Check that repeated publishing also ends. The database is away for `least_s` or longer.
    """
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    async with Witness(stack) as witness:
        driver = await Person(stack, cookie).sit_down()
        note = wire.Publish(driver.fence or 1, NOTES, "std_msgs/String", {"data": "Here."}, NOTES_HZ)
        assert isinstance(await driver.request_task(note), wire.Accepted)
        await hold(driver, 0.0, NOTICED_S, until=lambda: free(driver))
        await driver.hold_stick(
            0.0, TURN, lambda: turning(driver) and driver.state and driver.state.publishing
        )
        with database_away:
            away_s = time.time()
            await hold(driver, TURN, NOTICED_S, until=lambda: code(driver) == "not_recorded")
            assert driver.state
            assert "cannot be recorded" in driver.state.verdict.text
            # A new drive is refused at the first failure. Running tasks end after the time limit of records, or with
            # control, which the database no longer confirms: that may be earlier.
            await hold(driver, TURN, NOTICED_S, until=lambda: driver.state.publishing == [])
            await hold(driver, TURN, NOTICED_S, until=lambda: not turning(driver))
            assert away_s < witness.last_velocity_s < away_s + STANDS_S
            await hold(driver, TURN, away_s + least_s - time.time())

        back_s = time.time()
        await hold(driver, TURN, NOTICED_S, until=lambda: waits_for_neutral(driver))
        await hold(driver, TURN, LOOKED_S)
        assert witness.last_velocity_s < back_s, "the robot moved though the stick was never let go"

        await hold(driver, 0.0, NOTICED_S, until=lambda: free(driver))
        await driver.hold_stick(0.0, TURN, lambda: turning(driver))
        await hold(driver, 0.0, NOTICED_S, until=lambda: not turning(driver))
        await driver.__aexit__(None, None, None)
        log = await asyncio.to_thread(read_log, stack)
        notes_s = [one.at_s for one in witness.received if one.kind == "publish.start"]
        assert notes_s[-1] < away_s + STANDS_S, "the robot got a message that could not be recorded"
        # Repeated publishing has one record, but many messages: compare without them.
        received = [one for one in witness.received if one.kind != "publish.start"]
        assert log.findings + unrecorded(received, log.entries) == []
        since = [entry for entry in log.entries if entry.at_s > away_s]
        (published,) = (entry.outcome for entry in since if entry.kind == "publish.end")
        assert published in ENDED
        halted = [entry.details["words"] for entry in since if entry.outcome == "halted"]
        assert ENDED[published] in halted, halted


async def hold(driver: Driver, turn: float, seconds: float, until=None) -> None:
    """Hold the stick for this number of seconds; with `until`, until this is true, at most for these seconds."""
    end_s = time.monotonic() + seconds
    while not (until and until()):
        if time.monotonic() > end_s:
            assert until is None, f"not within {seconds} s; {driver.said_last()}"
            return
        await driver.drive(0.0, turn)
        await asyncio.sleep(DRIVE_PERIOD_S)


def free(driver: Driver) -> bool:
    """Return whether the bridge has received a neutral stick since control was taken."""
    state = driver.state
    return bool(state and state.fence == driver.fence and not state.neutral_needed)


def waits_for_neutral(driver: Driver) -> bool:
    """Return whether the person has control again, and has to let go of the stick."""
    state = driver.state
    has_control = state is not None and driver.fence is not None and state.fence == driver.fence
    return has_control and state.neutral_needed and code(driver) != "not_recorded"


def turning(driver: Driver) -> bool:
    return bool(driver.odometry and abs(driver.odometry.w) > TURNING_RADPS)


def code(driver: Driver) -> str:
    return driver.state.verdict.code if driver.state else ""
