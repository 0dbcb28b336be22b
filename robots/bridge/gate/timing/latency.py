"""The latency from a command to odometry that shows it, measured while the robot drives (docs/gate.md, 11).

After each large enough change of the commands, the odometry is compared with the calculated motion of a base
that has the profile's accelerations and receives these commands d seconds late. The d that fits best is one
measurement. A base that is slower than its profile gives a longer delay, which is safe. A base that does
something else (a person's joystick has priority, wheels slip) fits badly and gives no measurement.

The robot *answers* when it begins to obey a new command. Until it has answered once, and while its answer
takes longer than the measured latency, any delay is possible, so the longest delay is assumed. The delay of a
late answer counts until its measurement is complete.

Between two such changes the connection may become slow: every message still comes, one per period, but later
and later. The stamps show this, whatever the robot's clock is set to: arrival minus stamp rises above its
minimum. If only commands come later, their acknowledgements take longer than their minimum, and a base
without commands brakes by itself. The age of the newest odometry, by its stamp, always counts, whether
odometry is late or has stopped.

The stamps of a simulated clock show nothing of this: it runs slower or faster than ours, and pauses. Only silence
shows then that odometry is late.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.poses import Velocity

ADDED_S = 0.05  # added to the slowest measurement after fading: one period of the gate
LEAST_S = 0.10  # for any robot: a period of the gate, and a period of the laser (odometry carries its points)
KEPT = 12  # measurements
FADES_S = 0.015  # each later measurement reduces an earlier one by this, down to the median
FADES = 0.005  # each second reduces a measurement by this, in seconds
FORGOTTEN_S = 60.0  # after this rest, the measurements are no longer valid for the next drive
ENOUGH = 8  # with fewer measurements the assumed latency is kept, if it is longer

LONGEST_S = 0.8  # longest delay that is considered
_STEP_S = 0.01
_WINDOW_S = 1.2  # duration of the odometry that is compared
_CHANGE = (0.12, 0.30)  # m/s, rad/s: the smallest change that is measured
_RESPONSE = (0.03, 0.08)  # m/s, rad/s: a base that changed its speed by this has begun to obey
_SURPRISE_S = 0.05  # an answer that is later than expected by this may take any time
# The next three are in units of `_RESPONSE`:
_ASKED = 3.0  # smaller changes of the command need no answer
_ASTRAY = 2.0  # a base that is farther from a command than before by more than this does something else
_BRAKES = 1.5  # a base that is slower than all its commands by more than this brakes by itself
_MISFIT = 0.2  # share of the speed change: a worse fit gives no measurement

LATELY_S = 0.2  # the quickest message in this time counts: a single late one is jitter
LEAST_MESSAGES = 3
JITTER_S = 0.02  # jitter of the quickest message
USUAL = 0.1  # weight of the newest gap between two stamps in the usual gap
# Seconds per second: at this rate a lasting delay, also one from a slow clock, becomes the new minimum.
ACCEPTED = 0.002
MOST_BACKLOG_S = 1.0
BOTH_WAYS = 2.0  # commands use the same connection as messages: both directions are late
PACE_S, SLOW = 10.0, 0.9  # duration of a measurement of the clock's pace; a slower clock is named
HICCUP_S = 0.06  # a silence that is normal for a radio connection

Sample = tuple[float, float]  # seconds, m/s or rad/s


class Latency:
    """The latency of one robot. Call `sent` and `moved` in order of time (seconds, one monotonic clock)."""

    def __init__(self, limits: Limits, assumed_s: float) -> None:
        self._limits = limits
        self._assumed_s = assumed_s
        self.clock_is_simulated = False
        self.forget()

    def follow_clock(self, *, simulated: bool) -> None:
        """Note whether the robot's stamps are of a simulated clock."""
        if simulated != self.clock_is_simulated:
            self.clock_is_simulated = simulated
            self.forget()

    def forget(self) -> None:
        """Forget everything: after the robot's restart, old delays, stamps and commands are not valid."""
        self._axes = (
            _Axis(self._limits.linear_mps2, _CHANGE[0], _RESPONSE[0]),
            _Axis(self._limits.angular_radps2, _CHANGE[1], _RESPONSE[1]),
        )
        self._measured: deque[Sample] = deque(maxlen=KEPT)  # time of each measurement, and the latency
        # of these; the slowest without its fading by time, which is subtracted later
        self._median_s = self._slowest_s = 0.0
        self._answered = False
        self._answer_s = 0.0  # delay of the last late answer, until it is measured
        self._doubtful_until_s = -math.inf
        self._rests_since_s: float | None = None
        self._odometry = Backlog()
        self._backlogs = {"odometry": self._odometry}
        self._commands = Backlog()
        self._later_s = 0.0  # delay beyond the minimum, by the newest arrivals
        self._pace = Pace()

    def arrived(self, source: str, stamp_s: float, arrival_s: float, messages: int = 1) -> None:
        """Take the arrival of a new message of a source: odometry, or a laser. So many `messages` came together."""
        by_stamp_s = arrival_s if self.clock_is_simulated else stamp_s
        self._backlogs.setdefault(source, Backlog()).arrived(by_stamp_s, arrival_s, messages)
        if source == "odometry":
            self._pace.arrived(by_stamp_s, arrival_s)
        self._compare_backlogs()

    def acknowledged(self, took_s: float, now_s: float) -> None:
        """Take the round-trip time (s) of a twist and its acknowledgement by the robot's computer."""
        self._commands.took(took_s, now_s)
        self._compare_backlogs()

    def sent(self, velocity: Velocity, now_s: float) -> None:
        """Take a published twist."""
        if any(velocity):
            self._rests_since_s = None
        elif self._rests_since_s is None:
            self._rests_since_s = now_s
        elif now_s - self._rests_since_s > FORGOTTEN_S:
            self._measured.clear()
            self._answered, self._answer_s = False, 0.0
        for axis, value in zip(self._axes, (velocity.vx, velocity.w), strict=True):
            axis.sent(value, now_s)
        self._note_doubt(now_s)

    def moved(self, velocity: Velocity, now_s: float) -> None:
        """Take the velocity of new odometry."""
        expected_s = self._expected_s(now_s)
        for axis, value in zip(self._axes, (velocity.vx, velocity.w), strict=True):
            seen = axis.moved(value, now_s)
            if seen.answer_s is not None and seen.answer_s <= LONGEST_S:
                if seen.is_exact:
                    self._answered, self._doubtful_until_s = True, -math.inf
                if seen.answer_s > expected_s:
                    self._answer_s = seen.answer_s
            if seen.measured_s is not None:
                self._measured.append((now_s, seen.measured_s))
                self._sum_up()
                self._answered, self._answer_s = True, 0.0
        self._note_doubt(now_s)

    def _note_doubt(self, now_s: float) -> None:
        """Note a base that does not answer in time or does something else: it may obey at any time."""
        late = self._waited_s(now_s) > self._expected_s(now_s) + _SURPRISE_S
        if late or any(axis.is_astray or axis.brakes_by_itself for axis in self._axes):
            self._doubtful_until_s = now_s + LONGEST_S

    @property
    def measured_s(self) -> float | None:
        """Measured latency: the slowest recent measurement plus 50 ms; None with too few measurements."""
        return self._from_measurements(self._measured[-1][0]) if len(self._measured) >= ENOUGH else None

    @property
    def slow_clock(self) -> float | None:
        """Seconds that the robot's clock counts in one of ours, if it runs slow: a cause of lateness. Else None."""
        return self._pace.slow

    def in_force_s(self, now_s: float) -> float:
        """Return the latency for display and speed limits: measured, else assumed.

        It is longer while the robot's answer takes longer, and while its messages are late.
        """
        return max(self._expected_s(now_s), min(self._waited_s(now_s), LONGEST_S)) + self.lateness_s(now_s)

    def worst_s(self, now_s: float) -> float:
        """Return the latency to brake with: the longest that fits the observations, at least `in_force_s`."""
        if self._answered and now_s >= self._doubtful_until_s:
            return self.in_force_s(now_s)
        return max(LONGEST_S + self.lateness_s(now_s), self.in_force_s(now_s))

    def _waited_s(self, now_s: float) -> float:
        forward, turning = self._axes
        return max(forward.waited_s(now_s), turning.waited_s(now_s))

    def _expected_s(self, now_s: float) -> float:
        """Return the latency to expect from the earlier behaviour."""
        return max(self._from_measurements(now_s), self._answer_s)

    def lateness_s(self, now_s: float) -> float:
        """Return by how much the robot's messages are later now than at best (s). Zeros may be as late."""
        age_s = self._odometry.age_s(now_s)
        return max(self._later_s, age_s, BOTH_WAYS * age_s - HICCUP_S)

    def _compare_backlogs(self) -> None:
        later_s = max(backlog.later_s for backlog in self._backlogs.values())
        self._later_s = max(BOTH_WAYS * later_s, self._commands.later_s)

    def _from_measurements(self, now_s: float) -> float:
        """Return the slowest measurement after fading, at least the median of all, plus 50 ms."""
        if not self._measured:
            return self._assumed_s
        late_s = max(self._median_s, self._slowest_s - FADES * now_s) + ADDED_S
        return max(late_s, LEAST_S if len(self._measured) >= ENOUGH else self._assumed_s)

    def _sum_up(self) -> None:
        """Compute the values of the measurements that all queries need."""
        newest = len(self._measured) - 1
        self._median_s = sorted(late_s for _, late_s in self._measured)[len(self._measured) // 2]
        self._slowest_s = max(
            late_s - FADES_S * (newest - number) + FADES * at_s
            for number, (at_s, late_s) in enumerate(self._measured)
        )


class Backlog:
    """Delay of one source's messages beyond the shortest delay: by their stamps, or by measured times."""

    def __init__(self) -> None:
        self._lately: deque[Sample] = deque()  # times of arrival, and arrival minus stamp
        self._best_s = math.inf
        self._quicker_s: float | None = None  # delay of one message that was much quicker than the best one
        self._stamp_s = -math.inf
        self._gap_s = 0.0  # usual gap between stamps
        self.later_s = 0.0  # delay of the quickest recent message beyond the best one, without jitter

    def arrived(self, stamp_s: float, arrival_s: float, messages: int = 1) -> None:
        """Take the arrival of a new message, the newest of so many `messages`. If stamps go back, a clock was set."""
        if stamp_s < self._stamp_s:
            self._lately.clear()
            self._best_s = math.inf
        elif self._lately:
            self._gap_s += USUAL * (min((stamp_s - self._stamp_s) / messages, LATELY_S) - self._gap_s)
        self._stamp_s = stamp_s
        self.took(arrival_s - stamp_s, arrival_s)

    def age_s(self, now_s: float) -> float:
        """Return by how much the newest message is older than usual, by its stamp (s)."""
        # A stamp may be ahead
        best_s = min(self._best_s, self._lately[-1][1]) if self._lately else self._best_s
        return min(max(now_s - self._stamp_s - best_s - self._gap_s - JITTER_S, 0.0), MOST_BACKLOG_S)

    def took(self, after_s: float, now_s: float) -> None:
        """Take the time (s) from sending to arrival of a message, by one clock or two equally fast clocks."""
        passed_s = now_s - self._lately[-1][0] if self._lately else 0.0
        self._lately.append((now_s, after_s))
        while now_s - self._lately[0][0] > LATELY_S and len(self._lately) > LEAST_MESSAGES:
            self._lately.popleft()
        best_s = self._best_s + ACCEPTED * max(passed_s, 0.0)
        if after_s >= best_s - JITTER_S or math.isinf(best_s):
            self._best_s = min(best_s, after_s)
        elif self._quicker_s is None:  # the stamp may be wrong: a second such message confirms it
            self._best_s, self._quicker_s = best_s, after_s
        else:
            self._best_s, self._quicker_s = max(after_s, self._quicker_s), None
        quickest_s = min(after_s for _, after_s in self._lately)
        self.later_s = min(max(quickest_s - self._best_s - JITTER_S, 0.0), MOST_BACKLOG_S)


class Pace:
    """The pace of a robot's clock by the stamps of one source. A link that falls behind looks the same for a while."""

    def __init__(self) -> None:
        self._since: Sample | None = None  # stamp and arrival at the begin of the measurement
        self.slow: float | None = None  # seconds of the clock per second, if that is less than `SLOW`

    def arrived(self, stamp_s: float, arrival_s: float) -> None:
        """Take the arrival of a new message."""
        stamp_0_s, arrival_0_s = self._since or (stamp_s, arrival_s)
        passed_s = arrival_s - arrival_0_s
        if self._since and stamp_s >= stamp_0_s and passed_s < PACE_S:
            return
        pace = (stamp_s - stamp_0_s) / passed_s if passed_s > 0.0 else 1.0
        self._since, self.slow = (stamp_s, arrival_s), pace if 0.0 <= pace < SLOW else None


class _Seen(NamedTuple):
    """Evidence of one odometry sample for one axis."""

    answer_s: float | None = None  # time from the command until the base began to obey; it may be longer
    is_exact: bool = False  # the response cannot belong to an earlier command
    measured_s: float | None = None  # the measured delay, if this sample completes a measurement


class _Axis:
    """Forward or turning speed."""

    def __init__(self, acceleration: float, change: float, response: float) -> None:
        self._acceleration = acceleration
        self._change = change
        self._response = response
        self._commands: deque[Sample] = deque()
        self._before = 0.0  # the command before the oldest of these
        self._odometry: list[Sample] = []  # since the change
        self._speed: float | None = None
        self._since_s: float | None = None  # time at which the change began
        self._steady: float | None = None  # the speed that the base has kept since it last changed
        self._asked = 0.0
        # time since which the command differs from the base's speed, without an answer
        self._asked_s: float | None = None
        self._last_differing_s = -math.inf  # last time at which the command differed from the steady speed
        self._is_exact = False
        self._held: Sample = (math.inf, 0.0)  # time since which this command, or nearly this, is sent
        self._off = math.inf  # smallest distance of the speed from it, after the longest possible delay
        self.is_astray = False
        self.brakes_by_itself = False  # as bases do without commands: commands may be late

    def sent(self, value: float, now_s: float) -> None:
        last = self._commands[-1][1] if self._commands else self._before
        if value != last:
            self._commands.append((now_s, value))
        horizon_s = (self._since_s if self._since_s is not None else now_s) - LONGEST_S
        while len(self._commands) > 1 and self._commands[0][0] < horizon_s:
            self._before = self._commands.popleft()[1]
        if self._since_s is None and self._speed is not None and abs(value - self._speed) > self._change:
            self._since_s = now_s
            self._odometry = [(now_s, self._speed)]
        self._ask(value, now_s)

    def moved(self, value: float, now_s: float) -> _Seen:
        """Take a speed of the odometry; return its evidence."""
        self._speed = value
        off = abs(value - self._held[1])
        if now_s - self._held[0] > LONGEST_S:
            self._off = min(self._off, off)
        self.is_astray = off - self._off > _ASTRAY * self._response
        self.brakes_by_itself = (
            self._got_slower(value) and self._least_asked(value) - abs(value) > _BRAKES * self._response
        )
        answer = self._answer(value, now_s)
        if self._since_s is None:
            return answer
        self._odometry.append((now_s, value))
        if now_s - self._since_s < _WINDOW_S:
            return answer
        self._since_s = None
        delay_s = best_delay(self._commands, self._before, self._odometry, self._acceleration, self._change)
        return answer._replace(measured_s=delay_s)

    def _got_slower(self, value: float) -> bool:
        return self._steady is not None and abs(value) < abs(self._steady) - self._response

    def _least_asked(self, value: float) -> float:
        """Return the least speed, in the direction of `value`, of all commands that may be in effect."""
        sign = math.copysign(1.0, value)
        return min(sign * self._before, *(sign * asked for _, asked in self._commands), math.inf)

    def waited_s(self, now_s: float) -> float:
        """Return the time since a command that the base has not obeyed yet; 0 if this lasts too long."""
        if (
            self._asked_s is None
            or self._steady is None
            or abs(self._asked - self._steady) <= _ASKED * self._response
        ):
            return 0.0
        waited_s = now_s - self._asked_s
        return waited_s if waited_s < _WINDOW_S else 0.0

    def _ask(self, value: float, now_s: float) -> None:
        self._asked = value
        if math.isinf(self._held[0]) or abs(value - self._held[1]) > self._response:
            self._held, self._off = (now_s, value), math.inf
        if self._steady is None or abs(value - self._steady) <= self._response:
            self._asked_s = None
            return
        if self._asked_s is None:
            self._asked_s = now_s
            rests = abs(self._steady) <= self._response  # a moving base may brake by itself
            self._is_exact = rests and now_s - self._last_differing_s > LONGEST_S
        self._last_differing_s = now_s

    def _answer(self, value: float, now_s: float) -> _Seen:
        before = self._steady
        if before is None:
            self._steady = value
            return _Seen()
        if abs(value - before) <= self._response:
            return _Seen()
        obeys = self._asked_s is not None and (value - before) * (self._asked - before) > 0.0
        seen = (
            _Seen(now_s - self._asked_s, self._is_exact) if obeys and self._asked_s is not None else _Seen()
        )
        self._steady, self._asked_s = value, None
        self._ask(self._asked, now_s)
        return seen


def best_delay(
    commands: deque[Sample] | list[Sample],
    before: float,
    odometry: list[Sample],
    acceleration: float,
    change: float,
) -> float | None:
    """Return the delay (s) with which `commands` explain `odometry` best.

    None if no delay fits, or if the speed changed too little. `before`: the command before the first of
    `commands`. Speeds in m/s or rad/s.
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
    """Return the speeds (delays, times) of a base that obeys `commands` after each delay at its full rate."""
    history = np.array([(-math.inf, before), *commands])
    asked = history[np.searchsorted(history[:, 0], times[None, :] - delays[:, None], side="right") - 1, 1]
    speeds: NDArray[np.float64] = np.empty_like(asked)
    speeds[:, 0] = speed = np.full(len(delays), start)
    for column, passed_s in enumerate(np.diff(times), start=1):
        most = acceleration * passed_s
        speed = speed + np.clip(asked[:, column] - speed, -most, most)
        speeds[:, column] = speed
    return speeds
