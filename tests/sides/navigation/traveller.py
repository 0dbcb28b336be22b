"""The holder of control of a robot with navigation."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from tests.processes import PATIENCE_S
from tests.ros.bridge_support import BridgeProcess, Hand, Host, drivable, guarded_bridge, renewing

_numbers = itertools.count(1)

FAR, NEAR = (8.0, 2.0), (2.0, 1.8)
RENEW_S = 0.2
# On a busy computer odometry is late, and the first process that reads the map may find nothing
PASSING = {"no_map", "map_gone", "base_moving", "no_listener"}
CONTROL_S = 10.0  # longer than the product's 3 s: on a busy computer it can take longer to set a fault


class Traveller:
    """The holder of control of a robot with navigation: a program without a stick, which renews control."""

    def __init__(self, process: BridgeProcess, hand: Hand) -> None:
        self.process, self.hand, self.fence, self.goal = process, hand, 1, FAR

    def renew(self) -> None:
        self.hand.send(wire.Grant(self.fence, CONTROL_S, f"session-{self.fence}", "Ann", "ann", 1.0))

    def renewing(self) -> AbstractContextManager[None]:
        return renewing(self.renew, RENEW_S)

    def refused(self, x: float, y: float, heading: float = 0.0) -> wire.Refusal | None:
        self.renew()
        return self.hand.ask(wire.Go(self.fence, x, y, heading, next(_numbers)))

    def go(self, x: float, y: float, heading: float = 0.0) -> int:
        """Ask for a drive, again until the robot's map has come; return the number of the request."""
        until_s = time.monotonic() + PATIENCE_S
        with self.renewing():
            while True:
                self.renew()
                seq = next(_numbers)
                refusal = self.hand.ask(wire.Go(self.fence, x, y, heading, seq))
                if refusal is None:
                    return seq
                assert refusal.code in PASSING and time.monotonic() < until_s, refusal
                time.sleep(RENEW_S)

    def go_away(self, *places: tuple[float, float], heading: float = 0.0) -> int:
        """Ask for a drive to the farthest of some places: the last drive may have ended anywhere between them."""
        location = self.until(lambda state: state.location, "where the robot is").location
        assert location is not None
        here = location.x, location.y
        self.goal = max(places or (FAR, NEAR), key=lambda place: math.dist(place, here))
        return self.go(*self.goal, heading)

    def drives_until_ended(self) -> wire.GoEnd:
        """Drive to and fro until a drive ends before its goal: on a slow computer a map comes late."""
        for place in 2 * (FAR, NEAR):
            seq = self.go(*place)
            end = self.ended(seq)
            if end.outcome != "arrived":
                break
        return end

    def until(self, condition: Callable[[wire.State], Any], what: str) -> wire.State:
        """Renew control until `condition` is true for a state; return that state."""
        with self.renewing():
            return self.hand.state_until(condition, what)

    def drives(self) -> wire.State:
        """Renew control until navigation drives the base."""
        return self.until(lambda state: state.going and abs(state.odometry.vx) > 0.15, "a robot that drives")

    def ended(self, seq: int) -> wire.GoEnd:
        def over(state: wire.State) -> bool:
            return state.going_ended is not None and state.going_ended.seq == seq

        end = self.until(over, f"the end of drive {seq}").going_ended
        assert end is not None
        return end

    def stands(self) -> wire.State:
        return self.until(lambda state: state.going is None and speed(state) < 0.01, "a robot that stands")


def speed(state: wire.State) -> float:
    assert state.odometry is not None
    return max(abs(state.odometry.vx), abs(state.odometry.w) / 2)


@contextmanager
def travelling(config: BridgeConfig, host: Host, folder: Path) -> Iterator[Traveller]:
    """A guarded bridge, and who has control by it."""
    with guarded_bridge(config, host, folder) as (process, hand):
        yield in_control(process, hand)


def in_control(process: BridgeProcess, hand: Hand) -> Traveller:
    hand.state_until(drivable, "a robot that can be driven")
    hand.take_control(1)
    hand.let_go()
    return Traveller(process, hand)


def pause(traveller: Traveller, seconds: float) -> None:
    """Renew control for this number of seconds."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        traveller.renew()
        time.sleep(0.2)
