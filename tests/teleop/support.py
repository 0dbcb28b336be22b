"""A fake bridge that accepts everything, and pages that use the console as a browser does."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import datetime
from typing import Any, TypeVar

import msgspec
from channels.testing import WebsocketCommunicator

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.site.asgi import application
from robots.bridge.server.link_server import Link, LinkServer
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared import wire
from robots.shared.wire import Odometry, Refusal, State, StopState, Verdict
from teleop.background.database import in_database
from teleop.models import ControlSession

TIMEOUT_S = 20.0
PATIENCE_S = 20.0  # until something is recorded: a busy machine needs time
M = TypeVar("M", bound=msgspec.Struct)
T = TypeVar("T")

IDLE = State(
    phase="online",
    text="",
    stop=StopState("clear"),
    verdict=Verdict("idle", "", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    odometry=Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    sensors=[],
    battery_percent=80.0,
    charging=False,
    holder=None,
    fence=None,
    seq=None,
    neutral_needed=None,
    foreign=[],
    watchers=[],
    clock_skew_s=None,
    refused={},
)


async def eventually(find: Callable[[], T]) -> T:
    """Wait until `find()`, called in a database thread, returns a true value; return it."""
    end_s = time.monotonic() + PATIENCE_S
    while not (found := await in_database(find)):
        assert time.monotonic() < end_s, "it was not recorded"
        await asyncio.sleep(0.02)
    return found


def unavailable(*_args: Any, **_kwargs: Any) -> None:
    """Replaces `audit.record` when the database cannot be written."""
    raise AuditUnavailable("audit_disk_full", "Not done: the disk is full.")


def store_sessions(robot: Robot, user: User, starts: Iterable[datetime], ended_at: datetime) -> None:
    """Store one ended control session for each start, with fences from 0."""
    for fence, started_at in enumerate(starts):
        ControlSession.objects.create(
            robot=robot, user=user, fence=fence, started_at=started_at, ended_at=ended_at
        )


class FakeBridge:
    """The bridge's end of the link, without a robot. It stores all messages that it receives."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.heard: list[msgspec.Struct] = []
        self.raw: list[bytes] = []
        self.fence = 0
        self.refuses: Refusal | None = None  # if set, the refusal of every grant
        self.newest_stop = 0
        self.offers: wire.Offers | None = None
        self.silent = False  # answers no task request and no query
        self.refuses_tasks: Refusal | None = None
        self.answer: Callable[[wire.TopicQuery], msgspec.Struct] = lambda ask: wire.Parameters(
            ["/a"], ask.seq
        )
        self._server = LinkServer(link_address(robot), self._opened, self._message, lambda _link: None)
        self._more = asyncio.Condition()

    async def start(self) -> FakeBridge:
        await self._server.start()
        return self

    async def close(self) -> None:
        await self._server.close()

    def say(self, message: msgspec.Struct) -> None:
        """Send a message to every web process."""
        for link in self._server.links:
            link.report(message)

    def show(self, number: int) -> str:
        """Send a view with this number to every web process. Returns it as a page receives it."""
        state = msgspec.structs.replace(IDLE, seq=number)
        view = wire.encode(wire.View(state, None))
        for link in self._server.links:
            link.show(view)
        return view.decode()

    def tells_stop(self, state: str) -> None:
        """Send the state of the stop to every web process."""
        latch = StopState(state, number=self.newest_stop)
        self.say(wire.Status(msgspec.structs.replace(IDLE, stop=latch)))

    def shows(self, topic: str, number: int) -> str:
        """Send a sample of a topic to every web process. Returns it as a page receives it."""
        shown = wire.encode(wire.Sample(topic, "std_msgs/Int32", number, 5.0, 4, None, 1, {"data": number}))
        self.say(wire.LinkSample(topic, msgspec.Raw(shown)))
        return shown.decode()

    def cut(self) -> None:
        """End every link, as when the bridge dies."""
        for link in list(self._server.links):
            link._socket.transport.abort()

    def all(self, kind: type[M]) -> list[M]:
        return [message for message in self.heard if isinstance(message, kind)]

    async def hears(
        self, kind: type[M], fits: Callable[[M], bool] = lambda _message: True, count: int = 1
    ) -> M:
        """Wait for the `count`th message of this kind that fits, and return it."""

        def found() -> list[M]:
            return [message for message in self.all(kind) if fits(message)]

        async with self._more:
            await asyncio.wait_for(self._more.wait_for(lambda: len(found()) >= count), TIMEOUT_S)
        return found()[count - 1]

    def _opened(self, link: Link) -> None:
        link.report(wire.BridgeHello(wire.PROTOCOL, str(self.robot.id), self.robot.slug, self.fence))

    async def _message(self, link: Link, raw: bytes) -> None:
        message = wire.link_request(raw)
        match message:
            case wire.LinkHello():
                link.report(wire.Status(IDLE))
                if self.offers:
                    link.report(self.offers)
            case wire.LinkState():
                link.report(wire.Status(IDLE))
            case wire.Grant(fence=fence):
                self.fence = max(self.fence, fence)
                link.report(
                    wire.Refused("grant", self.refuses, fence=fence) if self.refuses else wire.Granted(fence)
                )
            case wire.LinkStop(by=by, seq=seq, press=press):
                self.newest_stop += 1
                link.report(wire.Stopped(StopState("stopping", by, number=self.newest_stop), seq, press))
            case wire.LinkClear(number=number, seq=seq):
                again = Refusal("stopped_again", "Pressed again since.", "stop")
                known = number == self.newest_stop
                link.report(
                    wire.Stopped(StopState("clear"), seq) if known else wire.Refused("link_clear", again, seq)
                )
            case _ if not self.silent:
                self._answer(link, message)
        async with self._more:
            self.heard.append(message)
            self.raw.append(raw)
            self._more.notify_all()

    def _answer(self, link: Link, message: msgspec.Struct) -> None:
        if isinstance(message, wire.LinkQuery):
            answer = wire.encode(self.answer(message.ask))
            link.report(wire.LinkAnswer(message.seq, msgspec.Raw(answer)))
        elif isinstance(message, wire.LinkVelocity):
            order = message.order
            if self.refuses_tasks:
                link.report(wire.Refused("velocity", self.refuses_tasks, order.seq, order.fence))
        elif isinstance(
            message,
            wire.TaskRequest | wire.LinkCancel | wire.LinkRecord | wire.LinkRecordEnd | wire.LinkKeep,
        ):
            kind, fence = wire.kind_of(message), getattr(message, "fence", None)
            if self.refuses_tasks:
                link.report(wire.Refused(kind, self.refuses_tasks, message.seq, fence))
            else:
                link.report(wire.Accepted(kind, message.seq, fence))


def _decoded(event: dict[str, Any]) -> dict[str, Any]:
    """Return a message; a camera picture as {"t": "picture", "encoded": ..., and the fields of its header}."""
    if event.get("text") is not None:
        return json.loads(event["text"])
    frame = event["bytes"]
    begin = 4 + int.from_bytes(frame[:4], "big")
    return {"t": "picture", "encoded": frame[begin:], **json.loads(frame[4:begin])}


class Page:
    """One page in one browser tab."""

    def __init__(self, headers: list[tuple[bytes, bytes]], path: str) -> None:
        self._socket = WebsocketCommunicator(application, path, headers=headers)
        self.inbox: list[dict[str, Any]] = []
        self.last_raw = ""

    async def open(self) -> Page:
        await self._socket.send_input({"type": "websocket.connect"})
        assert (await self._event())["type"] == "websocket.accept"
        return self

    async def close(self) -> None:
        """Close the connection, as when the tab is closed or its network fails."""
        await self._socket.send_input({"type": "websocket.disconnect", "code": 1001})
        await self._socket.wait(TIMEOUT_S)

    async def say(self, t: str, **fields: Any) -> None:
        await self.say_raw(json.dumps({"t": t, **fields}))

    async def say_raw(self, text: str) -> None:
        await self._socket.send_input({"type": "websocket.receive", "text": text})

    async def say_bytes(self, data: bytes) -> None:
        await self._socket.send_input({"type": "websocket.receive", "bytes": data})

    async def hears(self, t: str, **fields: Any) -> dict[str, Any]:
        """Return the next message of kind `t` with these fields; earlier messages go to `inbox`."""
        try:
            while True:
                message = await self._message()
                if message.get("t") == t and all(
                    message.get(name) == value for name, value in fields.items()
                ):
                    return message
                self.inbox.append(message)
        except TimeoutError as error:
            raise AssertionError(f"no {t} {fields}; instead: {self.inbox}") from error

    async def take(self) -> dict[str, Any]:
        """Take control; return the resulting `control` message."""
        await self.say("take")
        return await self.hears("control", state="yours")

    async def refused(self, code: str) -> dict[str, Any]:
        while True:
            message = await self.hears("refused")
            if message["refusal"]["code"] == code:
                return message
            self.inbox.append(message)

    async def is_closed(self) -> int:
        """Wait until the server closes the connection; return its code."""
        while True:
            event = await self._event()
            if event["type"] == "websocket.close":
                assert type(event.get("reason", "")) is str  # Autobahn takes no subclass
                return int(event["code"])
            self.inbox.append(_decoded(event))

    async def hears_nothing(self, t: str, within_s: float = 0.2) -> None:
        with suppress(asyncio.TimeoutError):
            while True:
                event = await asyncio.wait_for(self._socket.output_queue.get(), within_s)
                message = _decoded(event)
                assert message["t"] != t, message
                self.inbox.append(message)

    async def _message(self) -> dict[str, Any]:
        event = await self._event()
        assert event["type"] == "websocket.send", event
        self.last_raw = event.get("text", "")
        return _decoded(event)

    async def _event(self) -> dict[str, Any]:
        got = asyncio.ensure_future(self._socket.output_queue.get())
        await asyncio.wait({got, self._socket.future}, timeout=TIMEOUT_S, return_when="FIRST_COMPLETED")
        if not got.done():
            got.cancel()
            if self._socket.future.done():
                self._socket.future.result()
            raise TimeoutError
        return got.result()
