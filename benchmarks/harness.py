"""Figures, their limits, and how they are printed."""

from __future__ import annotations

import datetime
import json
import math
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Figure:
    """One measured number. It holds if it is not above its limit, or if it has no limit."""

    name: str
    value: float
    unit: str
    limit: float | None = None

    @property
    def holds(self) -> bool:
        """Return whether the limit holds. NaN means "not measured" and breaks the limit."""
        return self.limit is None or self.value <= self.limit

    def as_json(self) -> dict[str, object]:
        """Return the figure as JSON; a value that is no number is null."""
        return asdict(self) | {
            "value": self.value if math.isfinite(self.value) else None,
            "holds": self.holds,
        }

    def beside_limit(self) -> str:
        """Return the figure with its limit as text, such as ``p50 0.61 <= 0.8 ms ok``."""
        if self.limit is None:
            return f"{self.name} {self.value:.3g} {self.unit}"
        sign, word = ("<=", "ok") if self.holds else (">", "TOO MUCH")
        return f"{self.name} {self.value:.3g} {sign} {self.limit:g} {self.unit} {word}"


def quantile(values: Sequence[float], share: float) -> float:
    """Return the value that `share` of the values do not exceed; NaN if there are no values."""
    return float(np.quantile(values, share, method="higher")) if values else float("nan")


def progress(text: str) -> None:
    """Report progress on stderr; stdout is for figures."""
    print(text, file=sys.stderr, flush=True)


def machine() -> dict[str, str | int]:
    """Return facts about this machine."""
    models = [
        line.split(":", 1)[1].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    return {
        "processor": models[0] if models else platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "python": platform.python_version(),
        "load_before": f"{os.getloadavg()[0]:.2f}",
    }


def show(name: str, figures: Sequence[Figure], facts: dict[str, str | int], *, as_json: bool) -> bool:
    """Print the figures; return True if all hold."""
    holds = all(figure.holds for figure in figures)
    if as_json:
        rows = [figure.as_json() for figure in figures]
        day = datetime.datetime.now(datetime.UTC).date().isoformat()
        print(json.dumps({"bench": name, "date": day, "machine": facts, "figures": rows, "holds": holds}))
        return holds
    width = max((len(figure.name) for figure in figures), default=0)
    print(", ".join(f"{key} {value}" for key, value in facts.items()))
    for figure in figures:
        limit = "" if figure.limit is None else f"<= {figure.limit:g}"
        mark = "" if figure.limit is None else "ok" if figure.holds else "TOO MUCH"
        print(f"{figure.name:<{width}}  {figure.value:>9.3f} {figure.unit:<6} {limit:<9} {mark}".rstrip())
    limited = [figure.beside_limit() for figure in figures if figure.limit is not None]
    print(f"{name}: {'; '.join(limited)}")
    return holds
