"""Metrics of the other processes: web processes, and the pages processes of other web processes.

Each process listens on a Unix socket of this account in `FLEET_RUN_DIR`. The socket's name contains the
process number of the web process.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from socket import AF_UNIX, SOCK_STREAM, socket

from django.conf import settings
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.parser import text_string_to_metric_families

PATH = "/metrics"
ANSWER_S = 2.0
OWN = "own"  # parameter: only the figures of the process that answers


class _UnixConnection(HTTPConnection):
    """HTTP by a Unix socket."""

    def __init__(self, path: Path, host: str) -> None:
        super().__init__(host, timeout=ANSWER_S)
        self._path = str(path)

    def connect(self) -> None:
        self.sock = socket(AF_UNIX, SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self._path)


def of_others(host: str, authorization: str) -> Iterator[Metric]:
    """Yield the metrics of each other process, and which web processes answered.

    `host` and `authorization` are headers of the scrape: the other pages processes check the right to read
    again.
    """
    run: Path = settings.FLEET_RUN_DIR
    own = f"web-{os.getppid()}.sock"  # the web process started this one
    programs_sockets = sorted(run.glob("programs-*.sock"))
    asked = [(path, PATH) for path in programs_sockets]
    asked += [(path, f"{PATH}?{OWN}=1") for path in sorted(run.glob("web-*.sock")) if path.name != own]
    with ThreadPoolExecutor(max_workers=8) as pool:
        texts = list(pool.map(lambda one: _scraped(one[0], one[1], host, authorization), asked))
    for answer in filter(None, texts):
        yield from text_string_to_metric_families(answer)
    up = GaugeMetricFamily("fleet_web_up", "1: the web process answered the scrape.", labels=["web"])
    for path, text in zip(programs_sockets, texts, strict=False):
        up.add_metric([path.stem.split("-")[1]], float(text is not None))
    yield up


def _scraped(path: Path, target: str, host: str, authorization: str) -> str | None:
    connection = _UnixConnection(path, host)
    try:
        connection.request("GET", target, headers={"Authorization": authorization})
        answer = connection.getresponse()
        return answer.read().decode() if answer.status == 200 else None
    except (OSError, HTTPException):
        return None  # the process is ending or hangs: the metrics of the others are still useful
    finally:
        connection.close()
