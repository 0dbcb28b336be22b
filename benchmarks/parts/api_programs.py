"""Programs that use the API while somebody drives. They run in a separate process, like on other computers.

In the driver's process they would delay the driver itself, because they would share its interpreter.
"""

from __future__ import annotations

import http.client
import itertools
import json
import multiprocessing
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

from script.stack.stack import Stack

READERS = 10
READS_PER_S = 100.0
START_S, END_S = 20.0, 60.0


@dataclass
class Load:
    """The measurements of the programs, filled in when they have ended."""

    reads_ms: list[float] = field(default_factory=list)
    seconds: float = 0.0
    exported: int = 0  # records
    faults: list[str] = field(default_factory=list)  # of programs that ended too early


class Client:
    """A program with one connection."""

    def __init__(self, port: int, token: str) -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30.0)
        self._headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}

    def ask(self, method: str, path: str, body: object = None) -> float:
        """Send a request, and return the time to its answer in ms.

        Raises `AssertionError`: the answer is an error.
        """
        began_s = time.perf_counter()
        self._connection.request(
            method, f"/api/v1{path}", None if body is None else json.dumps(body), self._headers
        )
        answer = self._connection.getresponse()
        text = answer.read()
        if answer.status >= 400:
            raise AssertionError(f"{method} {path}: {answer.status} {text[:300]!r}")
        return 1000.0 * (time.perf_counter() - began_s)


@contextmanager
def running(stack: Stack, token: str, paths: Sequence[str], auditor: str = "") -> Iterator[Load]:
    """Context: programs read `READS_PER_S` times a second.

    If `auditor` is a token, a program exports the log, too.
    """
    load = Load()
    processes = multiprocessing.get_context("spawn")
    ours, theirs = processes.Pipe()
    process = processes.Process(target=_run, args=(theirs, stack.port, token, paths, auditor), daemon=True)
    process.start()
    theirs.close()
    try:
        if not ours.poll(START_S):
            raise TimeoutError("The programs did not start.")
        ours.recv()
        yield load
        ours.send("over")
        if not ours.poll(END_S):
            raise TimeoutError("The programs did not end.")
        load.__dict__.update(ours.recv().__dict__)
    finally:
        process.kill()
        process.join()
    if load.faults:
        raise AssertionError(f"programs beside the driver: {load.faults}")


def _run(ours: Connection, port: int, token: str, paths: Sequence[str], auditor: str) -> None:
    over, load = threading.Event(), Load()

    def program(work: Callable[..., None], *given: object) -> threading.Thread:
        def run() -> None:
            try:
                work(port, *given, over, load)
            except (OSError, http.client.HTTPException, AssertionError) as error:
                load.faults.append(repr(error))

        return threading.Thread(target=run, daemon=True)

    threads = [program(_read, token, paths, number) for number in range(READERS)]
    if auditor:
        threads.append(program(_export, auditor))
    for thread in threads:
        thread.start()
    began_s = time.monotonic()
    ours.send("started")
    ours.recv()
    load.seconds = time.monotonic() - began_s
    over.set()
    for thread in threads:
        thread.join()
    ours.send(load)


def _read(
    port: int, token: str, paths: Sequence[str], number: int, over: threading.Event, load: Load
) -> None:
    client = Client(port, token)
    period_s = READERS / READS_PER_S
    due_s = time.monotonic() + number * period_s / READERS
    for path in itertools.cycle(paths):
        if over.wait(max(0.0, due_s - time.monotonic())):
            return
        load.reads_ms.append(client.ask("GET", path))
        due_s += period_s


def _export(port: int, token: str, over: threading.Event, load: Load) -> None:
    """Export the whole log again and again, as one program, with one connection at a time."""
    headers = {"Authorization": f"Bearer {token}"}
    while not over.is_set():
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30.0)
        connection.request("POST", "/api/v1/audit/export?format=jsonl", headers=headers)
        answer = connection.getresponse()
        if answer.status != 200:
            raise AssertionError(f"export: {answer.status} {answer.read(300)!r}")
        while not over.is_set() and (piece := answer.read(64 * 1024)):
            load.exported += piece.count(b"\n")
        connection.close()
