"""The parts that the visitors of both ROS share: ``python -m tests.sides.visiting.ros1 SOCKET NAME``.

Each line is a command in JSON: `id`, `do` (a method), and its arguments. Each answer has the same `id`: `value`, what
the method returned; `error`; or `message`, as often as one comes. Names of types are those of ROS 1, such as
``nav_msgs/Odometry``; times are seconds; lists longer than `LONG` are their length.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Any

LONG = 1000


class Visitor:
    """One visitor. A subclass joins the robot, and adds what depends on its ROS."""

    def __init__(self, path: str, name: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(path)
        self._writing = threading.Lock()
        self.listeners: dict[int, Any] = {}
        self.speakers: dict[int, Any] = {}
        self.join(name)

    def join(self, name: str) -> None:
        raise NotImplementedError

    def leave(self) -> None:
        raise NotImplementedError

    def publish(self, id: int, of: int, fields: dict[str, Any]) -> None:
        raise NotImplementedError

    def repeat(self, id: int, of: int, hz: float, fields: dict[str, Any]) -> None:
        """Publish a message at this rate until its publisher is forgotten."""

        def speak() -> None:
            while of in self.speakers:
                with suppress(Exception):  # it is being forgotten
                    self.publish(id, of, fields)
                time.sleep(1.0 / hz)

        threading.Thread(target=speak, daemon=True).start()

    def tell(self, id: int, **answer: Any) -> None:
        line = json.dumps({"id": id, **answer}, separators=(",", ":")).encode() + b"\n"
        with self._writing:
            self._socket.sendall(line)

    def run(self) -> None:
        """Obey until the connection ends. Commands that wait have a thread each."""
        for line in self._socket.makefile():
            asked = json.loads(line)
            do = getattr(self, asked.pop("do"))
            if getattr(do, "waits", False):
                threading.Thread(target=self._obey, args=(do, asked), daemon=True).start()
            else:
                self._obey(do, asked)
        self.leave()
        os._exit(0)  # some of its threads never end

    def _obey(self, do: Callable[..., Any], asked: dict[str, Any]) -> None:
        try:
            answer = {"value": do(**asked)}
        except Exception:  # noqa: BLE001 - the test reads it
            answer = {"error": traceback.format_exc()}
        self.tell(asked["id"], **answer)


def waits(command: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a command that waits for others."""
    command.waits = True  # type: ignore[attr-defined]
    return command


def run(kind: type[Visitor]) -> None:
    kind(*sys.argv[1:]).run()
