"""A node beside the robot that a test drives: it listens, publishes, calls, serves and sends goals.

It is a program of its own (`tests.sides.visiting`), so that a test is the same for each ROS. Types have the names of
either ROS, messages have attributes as in both, times are seconds.
"""

from __future__ import annotations

import itertools
import json
import math
import queue
import socket
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from robots.shared.messages.type_names import bare
from tests.messages import Messages
from tests.processes import PATIENCE_S, end, until
from tests.ros.support import is_at
from tests.sides.side import Side


class Requests(Messages):
    """Requests of a service."""

    def take(self, answer: Any) -> None:
        self.put(answer.message)


class Inbox(Messages):
    """Messages of a topic. Each has its publisher's node as `by`."""

    def __init__(self, visitor: Visitor, topic: str, number: int) -> None:
        super().__init__(topic)
        self._visitor, self._number = visitor, number

    @property
    def publishers(self) -> int:
        """Number of connected publishers."""
        count: int = self._visitor.ask("publishers", of=self._number)
        return count

    def take(self, answer: Any) -> None:
        answer.message.by = answer.by
        self.put(answer.message)


class Speaker:
    """A publisher."""

    def __init__(self, visitor: Visitor, number: int) -> None:
        self._visitor, self._number = visitor, number

    @property
    def listeners(self) -> int:
        """Number of connected listeners."""
        count: int = self._visitor.ask("heard_by", of=self._number)
        return count

    def publish(self, **fields: Any) -> None:
        """Publish a message: ``publish(linear={"x": 0.5})``. Fields that are not named are zero or empty."""
        self._visitor.ask("publish", of=self._number, fields=fields)

    def repeat(self, hz: float, **fields: Any) -> None:
        """Publish a message again and again, until the end of the `with` block."""
        self._visitor.ask("repeat", of=self._number, hz=hz, fields=fields)


class Goal:
    """A goal of an action."""

    def __init__(self, action: str) -> None:
        self._accepted, self.feedback, self._ended = (
            Messages(f"{action}, {part}") for part in ("acceptance", "feedback", "end")
        )

    def take(self, answer: Any) -> None:
        for part, messages in (
            ("accepted", self._accepted),
            ("feedback", self.feedback),
            ("ended", self._ended),
        ):
            if hasattr(answer, part):
                messages.put(getattr(answer, part))

    def accepted(self) -> bool:
        """Wait for the answer to the goal; with ROS 1, for its begin or its refusal."""
        return bool(self._accepted.next())

    def ended(self) -> tuple[str, Any]:
        """Wait for the end; return it ("succeeded", "canceled", "aborted", "rejected") and the result."""
        end, result = self._ended.next()
        return end, result


class Visitor:
    """One such node."""

    def __init__(self, side: Side, folder: Path, name: str = "visitor") -> None:
        self.name = f"/{name}"
        self._numbers = itertools.count(1)
        self._answers: dict[int, queue.SimpleQueue[Any]] = {}
        self._taking: dict[int, Inbox | Requests | Goal] = {}
        log = folder / f"{name}.log"
        with (
            tempfile.TemporaryDirectory(prefix="fleet-test-") as short,
            socket.socket(socket.AF_UNIX) as door,
        ):
            path = f"{short}/visitor"
            door.bind(path)
            door.listen()
            door.settimeout(PATIENCE_S)
            self._program = side.fork(f"tests.sides.visiting.{side.name}", path, name, log=log)
            self._socket, _ = door.accept()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @contextmanager
    def listen(self, topic: str, kind: str, *, kept: bool = False, sensor: bool = False) -> Iterator[Inbox]:
        """Listen for the length of a `with` block. With ROS 2, `kept` messages and `sensor` data are asked for so."""
        number = next(self._numbers)
        inbox = Inbox(self, topic, number)
        self._taking[number] = inbox
        self.ask("listen", number, topic=topic, kind=_plain(kind), kept=kept, sensor=sensor)
        try:
            yield inbox
        finally:
            self.ask("forget", of=number)

    @contextmanager
    def speak(self, topic: str, kind: str, listeners: int = 1, *, kept: bool = False) -> Iterator[Speaker]:
        """Publish for the length of a `with` block. It begins when `listeners` nodes listen."""
        number = next(self._numbers)
        self.ask("speak", number, topic=topic, kind=_plain(kind), kept=kept)
        speaker = Speaker(self, number)
        try:
            until(lambda: speaker.listeners >= listeners, f"{listeners} listeners on {topic}")
            yield speaker
        finally:
            self.ask("forget", of=number)

    @contextmanager
    def serve(self, service: str, kind: str, **answer: Any) -> Iterator[Requests]:
        """Serve for the length of a `with` block, always with this answer; yield the requests."""
        number = next(self._numbers)
        self._taking[number] = requests = Requests(service)
        self.ask("serve", number, service=service, kind=kind, answer=answer)
        try:
            yield requests
        finally:
            self.ask("forget", of=number)

    @contextmanager
    def at(self, x: float, y: float, heading: float) -> Iterator[Inbox]:
        """Place the simulated robot, where the test before may have left it anywhere; yield its true poses."""
        with (
            self.listen("/ground_truth/pose", "nav_msgs/Odometry") as truth,
            self.speak("/ground_truth/teleport", "geometry_msgs/Pose2D") as teleport,
        ):
            teleport.publish(x=x, y=y, theta=heading)
            truth.until(lambda told: is_at(told.pose.pose, x, y, heading))
            yield truth

    def connected(self, *inboxes: Inbox) -> None:
        """Wait until each inbox has a publisher: messages sent before are lost."""
        until(lambda: all(inbox.publishers for inbox in inboxes), "publishers of what is listened to")

    def listeners(self, topic: str) -> list[str]:
        """Return the names of the nodes that listen to a topic."""
        names: list[str] = self.ask("topic_listeners", topic=topic)
        return names

    def call(self, service: str, kind: str, **fields: Any) -> Any:
        """Call a service; return its answer."""
        return self.ask("call", service=service, kind=kind, fields=fields)

    def parameter(self, node: str, name: str) -> Any:
        """Return a parameter: ``parameter("/play_motion", "motions.wave.joints")``."""
        return self.ask("parameter", node=node, name=name)

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        self.ask("set_parameter", node=node, name=name, value=value)

    def goal(self, action: str, kind: str, **fields: Any) -> Goal:
        """Send a goal: ``goal(motions.name, motions.type, motion_name="wave")``."""
        number = next(self._numbers)
        self._taking[number] = goal = Goal(action)
        self.ask("goal", number, action=action, kind=_plain(kind), fields=fields)
        return goal

    def cancel(self, action: str) -> None:
        """Cancel all goals of all clients of an action."""
        self.ask("cancel", action=action)

    def close(self) -> None:
        """Leave the robot."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._reader.join(PATIENCE_S)
        self._socket.close()
        end(self._program)
        self._program.stdin.close()

    def ask(self, do: str, number: int | None = None, **arguments: Any) -> Any:
        """Send a command of `tests.sides.visiting`; return what it returns."""
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        number = number or next(self._numbers)
        self._answers[number] = answers
        self._socket.sendall(json.dumps({"id": number, "do": do, **arguments}).encode() + b"\n")
        answer = answers.get(timeout=2 * PATIENCE_S)
        del self._answers[number]
        assert not hasattr(answer, "error"), answer.error
        return answer.value

    def _read(self) -> None:
        for line in self._socket.makefile():
            answer = json.loads(line, object_hook=lambda fields: SimpleNamespace(**fields))
            if hasattr(answer, "value") or hasattr(answer, "error"):
                self._answers[answer.id].put(answer)
            elif taking := self._taking.get(answer.id):
                taking.take(answer)


def place(truth: Messages) -> tuple[float, float, float]:
    """Return the robot's true pose now."""
    truth.settle()
    pose = truth.next().pose.pose
    return pose.position.x, pose.position.y, 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)


def _plain(type: str) -> str:
    """Return a type without what each ROS adds: ``nav_msgs/Path``, ``play_motion_msgs/PlayMotion`` of the action."""
    return bare(type).removesuffix("Action")
