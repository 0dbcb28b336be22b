"""Figures under an attack compared with slots without one, and broken limits. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from benchmarks.harness import Figure, quantile

ZERO_S = 0.35  # from a press to the first zero, worst
ENDED_ZERO_S = 1.0  # the same if the attack ends the bridge
ANSWER_S = 2.5  # from a press to the answer of REST, form or command line, worst: after 2 s it is "pending"
GAP_S = 0.1  # between two zeros while latched
TIMES = 1.5  # times the usual p99, under attacks of strangers at the web port
GOOD_ANSWERS = (": sent", ": no page", ": 200", ": 202", ": stopped", ": pending")
STILL_RADPS = 0.01


@dataclass(frozen=True)
class Press:
    """One press of the stop. An infinite time: not within the time limit."""

    zero_s: float  # until the first zero
    confirmed_s: float  # until the driver's page shows it
    gap_s: float  # the largest between two zeros, until the stop is cleared
    moved_radps: float  # fastest turn of the base while stopped, after it had time to brake


@dataclass
class Taken:
    """Measurements of the slots of one attack, or of all slots without one."""

    presses: list[Press] = field(default_factory=list)
    quick: list[tuple[str, float]] = field(default_factory=list)  # door and seconds until the first zero
    delays_s: list[float] = field(default_factory=list)  # of drive commands that arrived
    sent: int = 0  # drive commands
    lost: int = 0  # commands of `sent` that were never seen on the drive topic
    control_lost: int = 0  # times
    # Number of halts that the driver did not cause, by code
    halts: dict[str, int] = field(default_factory=dict)
    bridge_mb: tuple[float, float] = (math.nan, math.nan)  # before, maximum
    web_mb: tuple[float, float] = (math.nan, math.nan)
    records: int = 0  # added to the audit log
    lasted_s: float = 0.0
    answers: dict[str, int] = field(default_factory=dict)  # of the stop's doors
    answered_s: list[float] = field(default_factory=list)  # until REST, form or command line answered
    attacker: str = ""  # its last line of output
    fault: str = ""  # the reason why the attack's slots ended early

    def add(self, other: Taken) -> None:
        """Add the measurements of one more slot of the same kind."""
        self.presses += other.presses
        self.quick += other.quick
        self.delays_s += other.delays_s
        self.sent += other.sent
        self.lost += other.lost
        self.answered_s += other.answered_s
        self.control_lost += other.control_lost
        self.records += other.records
        self.lasted_s += other.lasted_s
        for ours, theirs in ((self.halts, other.halts), (self.answers, other.answers)):
            for key, number in theirs.items():
                ours[key] = ours.get(key, 0) + number
        self.bridge_mb = _least_and_most(self.bridge_mb, other.bridge_mb)
        self.web_mb = _least_and_most(self.web_mb, other.web_mb)
        self.attacker = other.attacker or self.attacker
        self.fault = self.fault or other.fault


@dataclass(frozen=True)
class Limits:
    """Limits under one attack. None: no limit."""

    zero_s: float = ZERO_S
    gap_s: float | None = GAP_S
    times: float | None = None  # times the usual p99, for stop and drive
    answer_s: float = ANSWER_S


def _least_and_most(ours: tuple[float, float], theirs: tuple[float, float]) -> tuple[float, float]:
    """Combine two slots: return the start of the first, and the maximum of both."""
    if math.isnan(theirs[0]):
        return ours
    return theirs if math.isnan(ours[0]) else (ours[0], max(ours[1], theirs[1]))


def figures(taken: Taken, usual: Taken, limits: Limits) -> list[Figure]:
    """Return the figures, times in ms, with their limits if any."""
    zeros, usual_zeros = _zeros(taken), _zeros(usual)
    every, usual_every = taken.delays_s, usual.delays_s
    return [
        *_three("stop", zeros, limits.zero_s),
        _ms("answered worst", _worst(taken.answered_s), limits.answer_s),
        _ms("confirmed worst", _worst(press.confirmed_s for press in taken.presses), None),
        _ms("gap between zeros", _worst(press.gap_s for press in taken.presses), limits.gap_s),
        *_three("drive", every, None),
        Figure("stop p99 / as usual", _ratio(zeros, usual_zeros), "times", limits.times),
        Figure("drive p99 / as usual", _ratio(every, usual_every), "times", limits.times),
        Figure(
            "moved while stopped", _worst(press.moved_radps for press in taken.presses), "rad/s", STILL_RADPS
        ),
        Figure("commands lost", 100.0 * taken.lost / taken.sent if taken.sent else math.nan, "%"),
        Figure("control lost", taken.control_lost, "times", 0.0 if limits.times else None),
        Figure("bridge before", taken.bridge_mb[0], "MB"),
        Figure("bridge most", taken.bridge_mb[1], "MB"),
        Figure("web before", taken.web_mb[0], "MB"),
        Figure("web most", taken.web_mb[1], "MB"),
        Figure("records", taken.records / taken.lasted_s if taken.lasted_s else math.nan, "/s"),
    ]


def broken(measured: Sequence[Figure], taken: Taken) -> list[str]:
    """Return the broken limits in words, and bad answers of doors.

    Good: the stop is confirmed, or pending.
    """
    faults = [taken.fault] if taken.fault else []
    faults += [f"answer of a door: {answer}" for answer in taken.answers if not answer.endswith(GOOD_ANSWERS)]
    return faults + [one.beside_limit() for one in measured if not one.holds]


def _zeros(taken: Taken) -> list[float]:
    return [press.zero_s for press in taken.presses] + [zero_s for _, zero_s in taken.quick]


def _three(name: str, seconds: Sequence[float], worst_s: float | None) -> list[Figure]:
    return [
        _ms(f"{name} p50", quantile(seconds, 0.50), None),
        _ms(f"{name} p99", quantile(seconds, 0.99), None),
        _ms(f"{name} worst", _worst(seconds), worst_s),
    ]


def _ms(name: str, seconds: float, limit_s: float | None) -> Figure:
    return Figure(name, 1000.0 * seconds, "ms", None if limit_s is None else 1000.0 * limit_s)


def _worst(values: Iterable[float]) -> float:
    """Return the maximum; not a number if there are no values."""
    return max(values, default=math.nan)


def _ratio(seconds: Sequence[float], usual: Sequence[float]) -> float:
    return quantile(seconds, 0.99) / quantile(usual, 0.99) if seconds and usual else math.nan


COLUMNS = (
    ("stop p50", "p50"),
    ("stop p99", "p99"),
    ("stop worst", "worst"),
    ("answered worst", "answer"),
    ("confirmed worst", "shown"),
    ("gap between zeros", "gap"),
    ("drive p50", "p50"),
    ("drive p99", "p99"),
    ("drive worst", "worst"),
    ("stop p99 / as usual", "stop x"),
    ("drive p99 / as usual", "drive x"),
    ("commands lost", "lost %"),
    ("control lost", "control"),
    ("bridge most", "bridge"),
    ("web most", "web"),
    ("records", "rec./s"),
)


def table(rows: Sequence[tuple[str, Sequence[Figure], Sequence[str]]]) -> str:
    """Return a line for each attack: figures (ms, MB), and whether its limits hold."""
    width = max(len(name) for name, _, _ in rows)
    heads = [head for _, head in COLUMNS]
    lines = [
        f"{'':<{width}} {'stop, ms':>46} {'drive, ms':>29}",
        f"{'':<{width}} " + " ".join(f"{head:>7}" for head in heads),
    ]
    for name, measured, faults in rows:
        values = {figure.name: figure.value for figure in measured}
        cells = " ".join(f"{_cell(values[key]):>7}" for key, _ in COLUMNS)
        lines.append(f"{name:<{width}} {cells}  {'ok' if not faults else 'BROKEN'}")
    return "\n".join(lines)


def _cell(value: float) -> str:
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "never"
    return f"{value:.1f}" if abs(value) < 100 else f"{value:.0f}"
