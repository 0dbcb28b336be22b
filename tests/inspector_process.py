"""An inspector in its own process, for tests of each ROS."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec

from robots.bridge.topics.inspector_messages import Done, InspectorQuery, KeepAlive, Ready
from robots.bridge.topics.inspector_messages import Report as InspectorReport
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import side_command
from tests.forked import ForkedProgram, forks_of
from tests.processes import PATIENCE_S, end

_report = msgspec.json.Decoder(InspectorReport)
_answer = msgspec.json.Decoder(wire.DoorAnswer)
_shown = msgspec.json.Decoder(wire.Sample)


class InspectorProcess:
    """One inspector, with this object as its bridge. The object sends signs of life, unless `silent`."""

    def __init__(self, config: BridgeConfig, environment: dict[str, str], silent: bool = False) -> None:
        program = side_command(config.ros, "inspector")[-1]
        self.process = ForkedProgram(program, environment=environment, forks=forks_of(config.ros), talks=True)
        self._said: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._shown: dict[str, queue.SimpleQueue[wire.Sample]] = {}
        self._number = 0
        self._write(msgspec.json.encode(config))
        threading.Thread(target=self._read, daemon=True).start()
        assert isinstance(self._said.get(timeout=PATIENCE_S), Ready)
        self._writing = threading.Lock()
        self._ended = threading.Event()
        if not silent:
            threading.Thread(target=self._live, daemon=True).start()

    def ask(self, question: Any, until_s: float | None = None) -> Any:
        """Send a query; return its answer. `until_s`: the time when the asker stops waiting."""
        self._number += 1
        self.send(InspectorQuery(self._number, question, until_s))
        return _answer.decode(
            self._reply(lambda r: isinstance(r, wire.LinkAnswer) and r.seq == self._number).answer
        )

    def done(self, request: Callable[[int], Any]) -> wire.Refusal | None:
        """Send a numbered request; return its refusal, None if the inspector did it."""
        self._number += 1
        self.send(request(self._number))
        refusal: wire.Refusal | None = self._reply(
            lambda r: isinstance(r, Done) and r.number == self._number
        ).refusal
        return refusal

    def subscribe(self, **topics: float) -> None:
        """Subscribe to these topics (names without slash) at these rates, Hz."""
        for name in topics:
            self._shown.setdefault(f"/{name}", queue.SimpleQueue())
        self.send(wire.LinkSubscribe({f"/{name}": rate for name, rate in topics.items()}))

    def shown(self, topic: str, condition: Callable[[wire.Sample], Any] = lambda _: True) -> wire.Sample:
        """Return the next sample of the topic for which `condition` is true."""
        deadline, last = time.monotonic() + PATIENCE_S, None
        while time.monotonic() < deadline:
            last = self._shown[topic].get(timeout=PATIENCE_S)
            if condition(last):
                return last
        raise AssertionError(f"no such message of {topic}; the last was {last}")

    def send(self, request: Any) -> None:
        with self._writing:
            self._write(wire.encode(request))

    def _live(self) -> None:
        """Send signs of life."""
        while not self._ended.wait(0.1):
            with suppress(ValueError, OSError):  # the process has ended
                self.send(KeepAlive())

    def stop(self) -> int:
        self._ended.set()
        with self._writing, suppress(BrokenPipeError):  # the process may have ended before
            self.process.stdin.close()
        try:
            return self.process.wait(PATIENCE_S)
        finally:
            end(self.process)

    def _write(self, line: bytes) -> None:
        self.process.stdin.write(line + b"\n")
        self.process.stdin.flush()

    def _reply(self, condition: Callable[[Any], bool]) -> Any:
        while not condition(report := self._said.get(timeout=PATIENCE_S)):
            pass
        return report

    def _read(self) -> None:
        for line in self.process.stdout:
            report = _report.decode(line)
            if isinstance(report, wire.LinkSample):
                self._shown[report.topic].put(_shown.decode(report.sample))
            else:
                self._said.put(report)
        self.process.stdout.close()
