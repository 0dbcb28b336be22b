"""People who stand, or walk back and forth along a path, also through obstacles."""

from __future__ import annotations

import itertools
import math

from robots.simulator.worlds import Person


class Walker:
    """One person and their position."""

    def __init__(self, person: Person) -> None:
        self.person = person
        self.x, self.y = person.at
        self.yaw = 0.0
        self.walks = person.walks and bool(person.path)
        self._targets = (
            itertools.cycle(person.path + person.path[-2:0:-1]) if person.path else None
        )  # to and fro
        self._target = next(self._targets) if self._targets else person.at

    def place(self, x: float, y: float) -> None:
        """Stand at this point."""
        self.x, self.y = x, y
        self.walks = False

    def walk(self) -> None:
        """Walk along the path, from here on."""
        self.walks = self._targets is not None

    def stand(self) -> None:
        """Stop walking."""
        self.walks = False

    def step(self, dt: float) -> None:
        """Walk for `dt` seconds, if walking."""
        if not self.walks:
            return
        dx, dy = self._target[0] - self.x, self._target[1] - self.y
        way = self.person.speed_mps * dt
        distance = math.hypot(dx, dy)
        if distance <= way:
            self.x, self.y = self._target
            self._target = next(self._targets) if self._targets else self._target
            return
        self.yaw = math.atan2(dy, dx)
        self.x += dx / distance * way
        self.y += dy / distance * way
