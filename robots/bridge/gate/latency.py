"""How long the robot takes from a command to odometry that shows it, measured while it is driven (GATE.md, T).

Each time the commands change by enough, what the odometry did after it is set beside what a base with the profile's
accelerations would have done with these commands, each of them late by d; the d that fits best is one measurement. A
base that is slower than its profile says counts as later, which errs on the safe side; one that does something else (a
joystick in somebody's hand has the say, wheels slip) fits badly and is no measurement.

Between two such changes a link may grow slow: every message still comes, one a period, but each of them later. That
shows in the stamps, whatever the robot's clock says: arrival less stamp rises above the least that it was. Where
commands alone come later, their acknowledgements do too: they take longer than the least that they took.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from robots.bridge.gate.values import Limits, Velocity

ADDED_S = 0.05  # on top of what 95 % of the measurements keep: one period of the gate
SHARE = 0.95
LEAST_S = 0.10  # however quick the robot is: a period of the gate, and one of the laser's that is carried by odometry
KEPT = 40  # measurements
ENOUGH = 8  # with fewer the assumed latency is kept, if it is longer

LONGEST_S = 0.8  # delays are looked for up to this
_STEP_S = 0.01
_WINDOW_S = 1.2  # of odometry that is compared
_CHANGE = (0.12, 0.30)  # m/s, rad/s: what is enough of a change
_RESPONSE = (0.03, 0.08)  # m/s, rad/s: from here on the base has begun to obey
_MISFIT = 0.2  # of the change: a worse fit is no measurement

LATELY_S = 0.5  # of these the quickest message counts: one that is late by itself is jitter
JITTER_S = 0.02  # of the quickest
# Seconds a second: so slowly a lasting delay is taken for what is usual, and a clock that runs slow for one in step.
ACCEPTED = 0.002
MOST_BACKLOG_S = 1.0
BOTH_WAYS = 2.0  # commands go the way that messages come

Sample = tuple[float, float]  # seconds, m/s or rad/s


class Latency:
    """Measures one robot. `sent` and `moved` in the order of their times (seconds, one monotonic clock)."""

    def __init__(self, limits: Limits, assumed_s: float) -> None:
        self._limits = limits
        self._assumed_s = assumed_s
        self.forget()

    def forget(self) -> None:
        """Begin anew: the robot was restarted, so its delays, its clock and what was sent before say nothing."""
        self._axes = (
            _Axis(self._limits.linear_mps2, _CHANGE[0], _RESPONSE[0]),
            _Axis(self._limits.angular_radps2, _CHANGE[1], _RESPONSE[1]),
        )
        self._measured: deque[float] = deque(maxlen=KEPT)
        self._in_force_s = self._assumed_s
        self._backlogs: dict[str, Backlog] = {}
        self._commands = Backlog()
        self._later_s = 0.0  # than at best, by the newest arrivals

    def arrived(self, source: str, stamp_s: float, arrival_s: float) -> None:
        """Something new came from a source: odometry, or a laser."""
        self._backlogs.setdefault(source, Backlog()).arrived(stamp_s, arrival_s)
        self._reckon_backlogs()

    def acknowledged(self, took_s: float, now_s: float) -> None:
        """So long the robot's machine took to acknowledge a twist: the way there and back."""
        self._commands.took(took_s, now_s)
        self._reckon_backlogs()

    def sent(self, velocity: Velocity, now_s: float) -> None:
        """A twist was published."""
        for axis, value in zip(self._axes, (velocity.vx, velocity.w), strict=True):
            axis.sent(value, now_s)

    def moved(self, velocity: Velocity, now_s: float) -> None:
        """Odometry arrived."""
        for axis, value in zip(self._axes, (velocity.vx, velocity.w), strict=True):
            measured_s = axis.moved(value, now_s)
            if measured_s is not None:
                self._measured.append(measured_s)
                self._in_force_s = self._from_measurements()

    @property
    def measured_s(self) -> float | None:
        """What the robot was measured to take, p95 and 50 ms; None while too little was measured."""
        return self._in_force_s if len(self._measured) >= ENOUGH else None

    def in_force_s(self, now_s: float) -> float:
        """The latency to reckon with: measured, else assumed; longer while the robot lets us wait for longer, and
        while its messages come later than at best.
        """
        waited_s = max(axis.waited_s(now_s) for axis in self._axes)
        return max(self._in_force_s, min(waited_s, LONGEST_S)) + self._later_s

    def _reckon_backlogs(self) -> None:
        later_s = max((backlog.later_s for backlog in self._backlogs.values()), default=0.0)
        self._later_s = max(BOTH_WAYS * later_s, self._commands.later_s)

    def _from_measurements(self) -> float:
        late_s = float(np.quantile(self._measured, SHARE, method="higher")) + ADDED_S
        return max(late_s, LEAST_S if len(self._measured) >= ENOUGH else self._assumed_s)


class Backlog:
    """How much later than at best the messages of one source come, by their stamps; or how much longer they take."""

    def __init__(self) -> None:
        self._lately: deque[Sample] = deque()  # arrivals, and how much later than its stamp each came
        self._best_s = math.inf
        self._stamp_s = -math.inf
        self.later_s = 0.0  # by how much even the quickest of late came later than the best one, jitter apart

    def arrived(self, stamp_s: float, arrival_s: float) -> None:
        """Something new came. Stamps go back only where a clock was set."""
        if stamp_s < self._stamp_s:
            self._lately.clear()
            self._best_s = math.inf
        self._stamp_s = stamp_s
        self.took(arrival_s - stamp_s, arrival_s)

    def took(self, after_s: float, now_s: float) -> None:
        """Something came so long after it was sent, by one clock or by two that keep step."""
        passed_s = now_s - self._lately[-1][0] if self._lately else 0.0
        self._lately.append((now_s, after_s))
        while now_s - self._lately[0][0] > LATELY_S:
            self._lately.popleft()
        self._best_s = min(self._best_s + ACCEPTED * max(passed_s, 0.0), after_s)
        quickest_s = min(after_s for _, after_s in self._lately)
        self.later_s = min(max(quickest_s - self._best_s - JITTER_S, 0.0), MOST_BACKLOG_S)


class _Axis:
    """Forward or turning speed."""

    def __init__(self, acceleration: float, change: float, response: float) -> None:
        self._acceleration = acceleration
        self._change = change
        self._response = response
        self._commands: deque[Sample] = deque()
        self._before = 0.0  # the command that held before the oldest of these
        self._odometry: list[Sample] = []  # since the change
        self._speed: float | None = None
        self._since_s: float | None = None  # the change began
        self._obeyed = True

    def sent(self, value: float, now_s: float) -> None:
        last = self._commands[-1][1] if self._commands else self._before
        if value != last:
            self._commands.append((now_s, value))
        horizon_s = (self._since_s if self._since_s is not None else now_s) - LONGEST_S
        while len(self._commands) > 1 and self._commands[0][0] < horizon_s:
            self._before = self._commands.popleft()[1]
        if self._since_s is None and self._speed is not None and abs(value - self._speed) > self._change:
            self._begin(self._speed, now_s)

    def moved(self, value: float, now_s: float) -> float | None:
        """The delay that this sample completes the measurement of, if it does."""
        self._speed = value
        if self._since_s is None:
            return None
        self._odometry.append((now_s, value))
        if abs(value - self._odometry[0][1]) > self._response:
            self._obeyed = True
        if now_s - self._since_s < _WINDOW_S:
            return None
        self._since_s = None
        return best_delay(self._commands, self._before, self._odometry, self._acceleration, self._change)

    def waited_s(self, now_s: float) -> float:
        """How long the base has done nothing yet about a change."""
        return 0.0 if self._since_s is None or self._obeyed else now_s - self._since_s

    def _begin(self, speed: float, now_s: float) -> None:
        self._since_s = now_s
        self._obeyed = False
        self._odometry = [(now_s, speed)]


def best_delay(
    commands: deque[Sample] | list[Sample],
    before: float,
    odometry: list[Sample],
    acceleration: float,
    change: float,
) -> float | None:
    """The delay in seconds with which `commands` explain `odometry` best; None if none does, or too little changed.

    `before` is the command that held before the first of `commands`; speeds in m/s or rad/s.
    """
    seen = np.array(odometry)
    times, speeds = seen[:, 0], seen[:, 1]
    if np.ptp(speeds) < change / 2.0 or not commands:
        return None
    delays = np.arange(0.0, LONGEST_S + _STEP_S / 2.0, _STEP_S)
    errors = np.sqrt(
        ((_played(commands, before, times, speeds[0], delays, acceleration) - speeds) ** 2).mean(axis=1)
    )
    best = int(errors.argmin())
    return float(delays[best]) if errors[best] < _MISFIT * np.ptp(speeds) else None


def _played(
    commands: deque[Sample] | list[Sample],
    before: float,
    times: NDArray[np.float64],
    start: float,
    delays: NDArray[np.float64],
    acceleration: float,
) -> NDArray[np.float64]:
    """Speeds (delays, times) of a base that takes `commands` up with each delay, within its acceleration."""
    history = np.array([(-math.inf, before), *commands])
    asked = history[np.searchsorted(history[:, 0], times[None, :] - delays[:, None], side="right") - 1, 1]
    speeds: NDArray[np.float64] = np.empty_like(asked)
    speeds[:, 0] = speed = np.full(len(delays), start)
    for column, passed_s in enumerate(np.diff(times), start=1):
        most = acceleration * passed_s
        speed = speed + np.clip(asked[:, column] - speed, -most, most)
        speeds[:, column] = speed
    return speeds
