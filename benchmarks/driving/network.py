"""Driving over slow networks: delay of commands, stops by the dead-man rule, no replay of stalled commands."""

from __future__ import annotations

import asyncio
import itertools
import math
import time

from benchmarks.driving.drive import BARE_STICKS, SHARE, Numbers, numbers_for
from benchmarks.harness import Figure, progress, quantile
from benchmarks.parts.cable import Cable, Profile
from benchmarks.parts.observer import Observer, Seen
from robots.shared.configuration.input_filters import COMMAND_LIFE_S
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack, temporary_stack

# Bandwidths and round trips are the values in browsers' developer tools. The losses are our assumption.
PROFILES = (
    Profile("GPRS", 50, 500, 0.01),
    Profile("2G", 250, 300, 0.01),
    Profile("good 2G", 450, 150, 0.01),
    Profile("3G", 750, 100, 0.01),
    Profile("good 3G", 1500, 40, 0.005),
    Profile("4G", 4000, 20, 0.002),
    Profile("DSL", 2000, 5, 0.001),
    Profile("Wi-Fi", 30000, 2, 0.002),
)
ROBOT = "tiago-1"
PERIOD_S = 0.05  # of a page's commands
DRIVE_S = 12.0
STALL_S = 1.5
NEUTRAL_S = 0.3
SLACK_S = 0.03  # allowed for the bridge's tick and its scheduling on two cores


def measure() -> list[Figure]:
    """Drive one robot over one network profile after the other."""
    with temporary_stack(BARE_STICKS[:1]) as stack:
        return asyncio.run(measure_on(stack))


async def measure_on(stack: Stack) -> list[Figure]:
    """Return all figures."""
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    figures: list[Figure] = []
    async with Observer(stack.robots[ROBOT]) as observer:
        for profile in PROFILES:
            progress(f"{profile.name} ...")
            async with (
                Cable(("127.0.0.1", 0), ("127.0.0.1", stack.port), profile) as cable,
                Driver(stack, ROBOT, cookie, port=cable.port) as driver,
            ):
                await driver.take()
                figures += await Trip(driver, observer, cable, profile).figures()
    return figures


class Trip:
    """One person driving over one network."""

    def __init__(self, driver: Driver, observer: Observer, cable: Cable, profile: Profile) -> None:
        self._driver = driver
        self._observer = observer
        self._cable = cable
        self._profile = profile
        self._numbers: Numbers = numbers_for(driver)
        self._sent: dict[int, float] = {}
        self._views = 0
        driver.on_frame = self._count

    async def figures(self) -> list[Figure]:
        """Drive, then drive through a stall."""
        name = self._profile.name
        self._observer.forget()
        await self._drive(DRIVE_S)
        arrived = self._numbers.arrivals(self._observer.commands)
        delays_s = [arrived[number] - sent_s for number, sent_s in self._sent.items() if number in arrived]
        away = stopped_share(self._observer.commands)
        views_hz = self._views / DRIVE_S
        late = await self._late_after_stall()
        return [
            Figure(f"{name} p50", 1000.0 * quantile(delays_s, 0.50), "ms"),
            Figure(f"{name} p95", 1000.0 * quantile(delays_s, 0.95), "ms"),
            Figure(f"{name} dead-man", 100.0 * away, "%"),
            Figure(f"{name} pictures", views_hz, "/s"),
            Figure(f"{name} replayed after a stall", late, "", 0),
        ]

    def _count(self, raw: bytes) -> None:
        self._views += raw.startswith(b'{"t":"view"')

    async def _drive(self, seconds: float) -> None:
        """Hold the stick. Let go, as a person does, when the page asks for neutral."""
        end_s = time.monotonic() + seconds
        neutral_until_s = 0.0
        for number in itertools.count(len(self._sent)):
            now_s = time.monotonic()
            if now_s >= end_s:
                return
            if (
                self._driver.state
                and self._driver.state.neutral_needed
                and now_s > neutral_until_s + NEUTRAL_S
            ):
                neutral_until_s = now_s + NEUTRAL_S
            self._sent[number] = now_s
            turn = 0.0 if now_s < neutral_until_s else self._numbers.turn(number)
            await self._driver.drive(0.0, turn, SHARE)
            await asyncio.sleep(PERIOD_S)

    async def _late_after_stall(self) -> int:
        """Return how many commands from the stall were carried out too late, network delay deducted."""
        arrivals = self._numbers.arrivals(self._observer.commands)
        fastest_s = min(
            (at_s - self._sent[number] for number, at_s in arrivals.items() if number in self._sent),
            default=self._profile.round_trip_ms / 2000.0,
        )
        first = len(self._sent)
        self._cable.freeze()
        thaw = asyncio.get_running_loop().call_later(STALL_S, self._cable.thaw)
        await self._drive(STALL_S + 2.0)
        thaw.cancel()
        await asyncio.sleep(1.0)
        allowed_s = fastest_s + COMMAND_LIFE_S + SLACK_S
        return sum(
            command.at_s - self._sent[number] > allowed_s
            for command in self._observer.commands
            if (number := self._numbers.number(command)) in self._sent
            and number is not None
            and number >= first
        )


def stopped_share(commands: list[Seen]) -> float:
    """Return the share of the time with zero commands, counted from the first motion."""
    moving = list(itertools.dropwhile(lambda command: command.still, commands))
    if len(moving) < 2:
        return math.nan
    stopped_s = sum(later.at_s - one.at_s for one, later in itertools.pairwise(moving) if one.still)
    return stopped_s / (moving[-1].at_s - moving[0].at_s)
