"""/metrics with many robots."""

from __future__ import annotations

import re
import time
import urllib.request
from collections.abc import Iterator

from benchmarks.growth.console import console
from benchmarks.harness import Figure, quantile
from script.stack.client import sign_in

ROBOTS = 20
TIMES = 20


def cost() -> Iterator[Figure]:
    """Measure the answer to a scrape."""
    with console(ROBOTS, 1) as running:
        cookie = sign_in(running, "staff")
        times_ms = []
        for _ in range(TIMES):
            request = urllib.request.Request(f"{running.url}/metrics", headers={"Cookie": cookie})  # noqa: S310
            began_s = time.perf_counter()
            with urllib.request.urlopen(request, timeout=30) as answer:  # noqa: S310
                text = answer.read().decode()
            times_ms.append(1000.0 * (time.perf_counter() - began_s))
    missing = ROBOTS - len(re.findall(r"^fleet_robot_online\{.*\} 1\.0$", text, re.MULTILINE))
    yield Figure(f"/metrics with {ROBOTS} robots: robots that are not in it", float(missing), "", 0.0)
    yield Figure(f"/metrics with {ROBOTS} robots: p50", quantile(times_ms[1:], 0.5), "ms", 200.0)
