"""Growth: what many fleet pages, robots and people cost.

`FLEET_BENCH_PARTS`: the parts to run, see PARTS. `FLEET_BENCH_SECONDS`: of each measurement of processor time.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

from benchmarks.growth import data, fleet_pages, robots, scrape, supervisor
from benchmarks.harness import Figure, progress

PARTS: dict[str, Callable[[], Iterator[Figure]]] = {
    "fleet-pages": fleet_pages.cost,
    "supervisor": supervisor.cost,
    "robots": robots.cost,
    "ros2": robots.cost_of_ros2,
    "metrics": scrape.cost,
    "people": data.people,
    "records": data.records,
}


def measure() -> list[Figure]:
    """Run all parts, or those of FLEET_BENCH_PARTS; print each figure as it comes."""
    figures = []
    for part in os.environ.get("FLEET_BENCH_PARTS", " ".join(PARTS)).split():
        for figure in PARTS[part]():
            progress(figure.beside_limit())
            figures.append(figure)
    return figures
