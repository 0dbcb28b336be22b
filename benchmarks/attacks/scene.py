"""A person who drives, repeated stops, and the messages to the robot, while other software also drives."""

from __future__ import annotations

import asyncio
import itertools
import math
import random
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from websockets.exceptions import ConnectionClosed, WebSocketException

from benchmarks.attacks.doors import Doors
from benchmarks.attacks.figures import Press, Taken
from benchmarks.attacks.incidents import Incident
from benchmarks.driving.drive import PERIOD_S, SHARE, Numbers, numbers_for
from benchmarks.driving.stop import ROBOT
from benchmarks.parts.observer import Observer
from benchmarks.parts.priority import prefer_witness
from robots.shared import wire
from script.stack.client import Driver
from script.stack.stack import Stack

RUN_UP_S = 0.25  # until the base turns at its speed
DRIVEN_S = 0.75  # including the run-up
QUICK_S = 0.1  # of driving before a quick press
LATCHED_S = 0.35  # duration of a stop
LONG_S, LONG_EVERY = 2.0, 5  # each fifth stop lasts longer, to check that the base stays at rest
BRAKED_S = 1.2  # after the first zero
ZERO_PATIENCE_S, CONFIRMED_PATIENCE_S = 5.0, 6.0
READY_S = 30.0  # until control is back, without an attack
ATTACKED_S = 4.0  # the same under attack; then the stop is pressed without control
HOPELESS = 4  # the slot ends after this number of presses in a row that did not reach the robot
LIFE_S = 0.3  # of a command: a younger command at the press is not counted as lost
OWN_HALTS = {"stopped", "stop_cleared", "control_taken"}
FAULTS = (OSError, ConnectionClosed, WebSocketException, TimeoutError, asyncio.TimeoutError)


class LostError(RuntimeError):
    """The console did not answer again, or control could not be taken again."""


class Scene:
    """One robot with its driver, the stop's doors and an observer; `scene_on` makes it."""

    def __init__(self, stack: Stack, cookie: str, observer: Observer, doors: Doors, seed: int) -> None:
        self.stack = stack
        self.taken = Taken()  # of the current slot
        self._cookie = cookie
        self._observer = observer
        self._doors = doors
        self._chance = random.Random(seed)  # noqa: S311 - when the stop is pressed
        self._driver: Driver | None = None
        self._numbers: Numbers | None = None
        self._numbering = itertools.count()
        self._sent: dict[int, float] = {}
        self._drives = False
        self.calm = True  # no attack is running
        self._had_control = False
        self._halt = ""

    # --- driving -------------------------------------------------------------------------------------

    async def hold(self) -> None:
        """Send the stick position 50 times a second until cancelled."""
        due_s = time.monotonic()
        while True:
            with suppress(*FAULTS):
                await self._send_stick()
            due_s = max(due_s + PERIOD_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())

    async def _send_stick(self) -> None:
        driver = self._driver
        if driver is None or driver.closed or driver.fence is None or self._numbers is None:
            return
        needed = driver.state.neutral_needed if driver.state else None
        if needed is not None and self._drives and needed.code not in OWN_HALTS and needed.code != self._halt:
            self.taken.halts[needed.code] = self.taken.halts.get(needed.code, 0) + 1
        self._halt = needed.code if needed else ""
        if needed is not None or not self._drives:
            await driver.drive(0.0, 0.0, SHARE)
            return
        number = next(self._numbering)
        self._sent[number] = time.monotonic()
        await driver.drive(0.0, self._numbers.turn(number), SHARE)

    async def ready(self, patience_s: float = READY_S) -> Driver:
        """Return a page with control of a robot that is not stopped.

        Raises `LostError` after `patience_s`.
        """
        end_s = time.monotonic() + patience_s
        while True:
            try:
                return await self._sit_down()
            except FAULTS as error:
                if time.monotonic() > end_s:
                    raise LostError(f"no control for {patience_s:g} s ({error})") from error
                await asyncio.sleep(0.2)

    async def _sit_down(self) -> Driver:
        if self._driver is None or self._driver.closed:
            had_control = self._had_control
            await self.leave()
            self._had_control = had_control
            self._driver = self._doors.driver = await Driver(self.stack, ROBOT, self._cookie).__aenter__()
            self._numbers = numbers_for(self._driver)
        driver = self._driver
        await driver.until(lambda: driver.state and not driver.gone and driver.state.phase == "online", 5.0)
        if driver.fence is None:
            if self._had_control:
                self.taken.control_lost += 1
            self._had_control = False
            await driver.send(wire.Take())
            await driver.until(lambda: driver.fence is not None, 2.0)
        self._had_control = True
        if driver.state and driver.state.stop.state != "clear":
            await driver.send(wire.Clear(driver.state.stop.number))
            await driver.until(lambda: driver.state and driver.state.stop.state == "clear", 2.0)
        return driver

    async def leave(self) -> None:
        """Close the page. Control ends with the page: this does not count as lost control."""
        self._had_control = False
        driver, self._driver, self._doors.driver = self._driver, None, None
        if driver is not None:
            with suppress(*FAULTS, asyncio.CancelledError):
                await asyncio.wait_for(driver.__aexit__(), 5.0)

    async def play(self) -> None:
        """Request a motion, while the base stands."""
        driver = await self.ready()
        await asyncio.sleep(0.5)
        with suppress(*FAULTS):
            await driver.request_task(wire.Play(driver.fence or 1, "open"))
            await asyncio.sleep(0.5)

    # --- a press -------------------------------------------------------------------------------------

    async def press(self, door: str, number: int) -> None:
        """Drive, press at this door, wait with the stop latched. Add the results to `taken`."""
        before = await self._drive(READY_S if self.calm else ATTACKED_S)
        pressed_s = self._doors.press(door)
        zero_s, confirmed_s = await asyncio.gather(
            self._first_zero(pressed_s), self._confirmed(before, pressed_s)
        )
        held_s = LONG_S if number % LONG_EVERY == LONG_EVERY - 1 else LATCHED_S
        begin_s = min(zero_s, confirmed_s)
        if math.isfinite(begin_s):
            await asyncio.sleep(max(0.0, begin_s + held_s - (time.monotonic() - pressed_s)))
        self._note(pressed_s, confirmed_s)
        self._note_drive(pressed_s)

    async def press_quickly(self, door: str) -> None:
        """Drive for a moment, and press at this door.

        Many quick presses give the distribution of the delay.
        """
        before = await self._drive(READY_S if self.calm else ATTACKED_S, QUICK_S)
        pressed_s = self._doors.press(door)
        zero_s, _ = await asyncio.gather(self._first_zero(pressed_s), self._confirmed(before, pressed_s))
        self._drives = False
        self.taken.quick.append((door, zero_s))

    async def strike(self, incident: Incident, doors: list[str]) -> None:
        """Drive, strike, press at several doors while the bridge is away, and wait for the confirmed stop."""
        before = await self._drive(READY_S)
        self._note_drive(time.monotonic())
        struck_s = time.monotonic()
        undo = await incident.strike(self.stack)
        pressed: list[float] = []
        for door, after_s in zip(doors, incident.presses_s, strict=True):
            await asyncio.sleep(max(0.0, struck_s + after_s - time.monotonic()))
            pressed.append(self._doors.press(door))
        await undo()
        first_s = pressed[0]
        _, confirmed_s = await asyncio.gather(
            self._first_zero(first_s), self._confirmed(before, first_s, READY_S / 2)
        )
        confirmed_s += first_s
        await asyncio.sleep(LONG_S)
        for pressed_s in pressed:
            self._note(pressed_s, confirmed_s - pressed_s)

    async def _drive(self, patience_s: float, driven_s: float = DRIVEN_S) -> int:
        """Drive for a moment, if control comes within `patience_s`. Return the number of the last stop.

        Raises `LostError` without control, except under attack.
        """
        try:
            driver = await self.ready(patience_s)
            await driver.drive(0.0, 0.0, SHARE)
        except (LostError, *FAULTS) as error:
            if self.calm:
                raise LostError(str(error)) from error
            driver = None
        self._observer.forget()
        self._sent.clear()
        self._drives = True
        if driver is not None:
            with suppress(*FAULTS):  # after a stop the stick is neutral first
                await self._observer.until(
                    lambda: any(not seen.still for seen in self._observer.commands), 1.0
                )
        await asyncio.sleep(driven_s + 0.05 * self._chance.random())
        return driver.state.stop.number if driver and driver.state else 0

    async def _first_zero(self, pressed_s: float) -> float:
        """Return the seconds from the press to the first zero; infinite: there was none."""

        def zero() -> bool:
            commands = self._observer.commands
            return any(seen.still and seen.at_s >= pressed_s for seen in commands)

        with suppress(TimeoutError):
            await self._observer.until(zero, ZERO_PATIENCE_S)
        return self._zeros(pressed_s)[0] - pressed_s if zero() else math.inf

    def _zeros(self, since_s: float) -> list[float]:
        return [seen.at_s for seen in self._observer.commands if seen.still and seen.at_s >= since_s]

    async def _confirmed(
        self, before: int, pressed_s: float, patience_s: float = CONFIRMED_PATIENCE_S
    ) -> float:
        """Return the seconds from the press until the driver's page shows the stop; infinite: it did not."""
        end_s = pressed_s + patience_s
        while (now_s := time.monotonic()) < end_s:
            driver = self._driver
            if driver is None or driver.closed:
                with suppress(*FAULTS):
                    await self.leave()
                    self._driver = self._doors.driver = await Driver(
                        self.stack, ROBOT, self._cookie
                    ).__aenter__()
                await asyncio.sleep(0.1)
                continue
            state = driver.state
            if not driver.gone and state and state.stop.state != "clear" and state.stop.number != before:
                return now_s - pressed_s
            with suppress(*FAULTS):
                await driver.until(
                    lambda driver=driver: (  # type: ignore[misc]
                        driver.state and driver.state.stop.number != before and not driver.gone
                    ),
                    0.25,
                )
        return math.inf

    def _note(self, pressed_s: float, confirmed_s: float) -> None:
        end_s = time.monotonic()
        zeros = self._zeros(pressed_s)
        gaps = [after - before for before, after in itertools.pairwise([*zeros, end_s])]
        moved = [abs(seen.w) for seen in self._observer.truth if zeros and seen.at_s > zeros[0] + BRAKED_S]
        zero_s = zeros[0] - pressed_s if zeros else math.inf
        self.taken.presses.append(
            Press(zero_s, confirmed_s, max(gaps, default=math.inf), max(moved, default=0.0))
        )

    def _note_drive(self, pressed_s: float) -> None:
        """Count this drive's commands that had time to arrive, and those that arrived."""
        self._drives = False
        if self._numbers is None:
            return
        arrived = self._numbers.arrivals(self._observer.commands)
        began_s = min(self._sent.values(), default=math.inf) + RUN_UP_S
        for number, sent_s in self._sent.items():
            if sent_s < began_s or sent_s >= pressed_s:
                continue
            if number in arrived:
                self.taken.sent += 1
                self.taken.delays_s.append(arrived[number] - sent_s)
            elif sent_s < pressed_s - LIFE_S:
                self.taken.sent += 1
                self.taken.lost += 1
        if not self._sent:
            self.taken.sent += 1
            self.taken.lost += 1

    # --- a slot --------------------------------------------------------------------------------------

    def begin_slot(self, *, calm: bool) -> None:
        self.calm = calm
        self._drives = False
        self.taken = Taken()
        self._doors.answers.clear()
        self._doors.answered_s.clear()

    @property
    def hopeless(self) -> bool:
        """Return whether none of the last presses reached the robot."""
        last = self.taken.presses[-HOPELESS:]
        return len(last) == HOPELESS and all(math.isinf(press.zero_s) for press in last)

    def end_slot(self) -> Taken:
        """Return the measurements of the slot."""
        self.taken.answers = dict(self._doors.answers)
        self.taken.answered_s = list(self._doors.answered_s)
        return self.taken


@asynccontextmanager
async def scene_on(stack: Stack, driver: str, presser: str, token: str, seed: int) -> AsyncIterator[Scene]:
    """Context: a scene. `driver`, `presser`: the cookies of the people who drive and who press the stop.

    `token`: of a program that presses the stop, too.
    """
    async with (
        Observer(stack.robots[ROBOT], "truth") as observer,
        Doors(stack, presser, token) as doors,
    ):
        prefer_witness(observer.pid)
        scene = Scene(stack, driver, observer, doors, seed)
        holding = asyncio.create_task(scene.hold())
        try:
            yield scene
        finally:
            holding.cancel()
            await scene.leave()
