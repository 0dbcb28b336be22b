"""Sends a client the transforms that it asked for, when they have changed: what tf2_web_republisher does on a robot.

roslibpy asks by the service /republish_tfs and gets a topic; roslibjs sends a goal to the action /tf2_web_republisher
and gets feedback.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from robots.shared.sentences import say
from robots.shared.wire import Form, NotDone, Refusal, TapState
from teleop.rosbridge.family import Client, Family, Handler, Service
from teleop.rosbridge.operations import Publish
from teleop.rosbridge.tf.tree import TfMessage, Transform, Tree, moved
from teleop.tap.feed import TapMessage, TapReader, feed_of

SERVICE, ACTION = "/republish_tfs", "/tf2_web_republisher"
TOPICS = ("/tf", "/tf_static")
QUEUE = 100  # messages of these that may wait
MOST_ASKED = 20  # by one client at once
FASTEST_HZ, SLOWEST_HZ = 50.0, 0.1
FRAMES_PER_S = 1000.0  # found for one client: each takes 0.1 ms of a processor
AT_ONCE = 10  # frames, then drive input that has come meanwhile is handled

_TOO_MANY = Refusal("busy", "Too many requests at once: wait for the answers.", "wire")
_decode = msgspec.json.Decoder(TfMessage).decode


# Sends transforms. Returns False if the client does not listen yet
Send = Callable[[list[dict[str, Any]]], Awaitable[bool]]


class Wanted(Struct):
    """A request for transforms. Thresholds: metres, radians; a smaller change is not sent."""

    source_frames: Annotated[list[Annotated[str, Meta(max_length=200)]], Meta(max_length=200)] = []
    target_frame: Annotated[str, Meta(max_length=200)] = ""
    angular_thres: float = 0.0
    trans_thres: float = 0.0
    rate: float = 10.0


@dataclass
class _Sent:
    """The transforms that one request has got so far."""

    wanted: Wanted
    send: Send
    due_s: float = 0.0
    last: dict[str, Transform] = field(default_factory=dict)


class Transforms(Family):
    """The transforms that a client asked for."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._tree = Tree()
        self._asked: dict[str, _Sent] = {}  # by topic, or by id of the goal
        self._numbers = count(1)
        self._reader: TapReader | None = None
        self._task: asyncio.Task[None] | None = None

    def service(self, name: str) -> Service | None:
        return self._republish if name == SERVICE else None

    def services(self) -> Mapping[str, str]:
        return {SERVICE: "tf2_web_republisher/RepublishTFs"}

    def publisher(self, topic: str) -> Handler | None:
        return {f"{ACTION}/goal": self._goal, f"{ACTION}/cancel": self._cancel}.get(topic)

    def leave(self) -> None:
        self._asked.clear()
        self._rest()

    # --- requests ---------------------------------------------------------------------------------------

    async def _republish(self, arguments: dict[str, Any]) -> dict[str, Any]:
        topic = f"/fleet/transforms_{next(self._numbers)}"

        async def send(transforms: list[dict[str, Any]]) -> bool:
            return await self._show(topic, {"transforms": transforms})

        self._begin(topic, arguments, send)
        return {"topic_name": topic}

    async def _goal(self, operation: Publish) -> None:
        goal_id, goal = operation.msg.get("goal_id"), operation.msg.get("goal")
        id_ = goal_id.get("id") if isinstance(goal_id, dict) else None

        async def send(transforms: list[dict[str, Any]]) -> bool:
            status = {"goal_id": {"stamp": {"secs": 0, "nsecs": 0}, "id": id_}, "status": 1, "text": ""}
            feedback = {"status": status, "feedback": {"transforms": transforms}}
            return await self._show(f"{ACTION}/feedback", feedback)

        self._begin(str(id_)[:200], goal if isinstance(goal, dict) else {}, send)

    async def _cancel(self, operation: Publish) -> None:
        if id_ := operation.msg.get("id"):
            self._asked.pop(str(id_), None)
        else:
            self._asked.clear()
        if not self._asked:
            self._rest()

    def _begin(self, key: str, given: dict[str, Any], send: Send) -> None:
        self.client.require(Scope.TOPICS)
        if len(self._asked) >= MOST_ASKED and key not in self._asked:
            raise NotDone(_TOO_MANY)
        try:
            wanted = msgspec.convert(given, Wanted)
        except msgspec.ValidationError as error:
            text = say("The message does not fit: {error}", error=str(error))
            raise NotDone(Refusal("invalid", text, "wire")) from error
        self._asked[key] = _Sent(wanted, send)
        link = self.client.hub.link
        if self._reader is None or self._reader.feed.link is not link:
            self._rest()
            self._reader = TapReader(feed_of(link), self._deliver, self._state, lambda: False)
            for topic in TOPICS:
                self._reader.read(topic, "json", queue=QUEUE)
        if self._task is None:
            self._task = asyncio.create_task(self._keep_sending())

    def _rest(self) -> None:
        """Read and send no more."""
        if self._reader is not None:
            self._reader.leave()
            self._reader = None
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _show(self, topic: str, message: dict[str, Any]) -> bool:
        return any([await family.show(topic, message) for family in self.client.families])

    # --- transforms -------------------------------------------------------------------------------------

    def _state(self, _state: TapState) -> None:
        """Say nothing: of a frame that is not known a client hears nothing, as from tf2_web_republisher."""

    async def _deliver(self, _topic: str, _form: Form, message: TapMessage) -> None:
        with suppress(msgspec.DecodeError):  # NaN is null here: no transform
            self._tree.take(_decode(message.body))

    async def _keep_sending(self) -> None:
        while True:
            now_s = time.monotonic()
            frames = sum(len(asked.wanted.source_frames) for asked in self._asked.values())
            for asked in list(self._asked.values()):
                if asked.due_s <= now_s:
                    pause_s = 1.0 / min(max(asked.wanted.rate, SLOWEST_HZ), FASTEST_HZ)
                    asked.due_s = now_s + max(pause_s, frames / FRAMES_PER_S)
                    changed = await self._changed(asked)
                    if changed and await asked.send(_stamped(asked.wanted.target_frame, changed)):
                        asked.last |= changed
            due_s = min((asked.due_s for asked in self._asked.values()), default=now_s + 1.0)
            await asyncio.sleep(max(due_s - time.monotonic(), 1.0 / FASTEST_HZ / 2.0))

    async def _changed(self, asked: _Sent) -> dict[str, Transform]:
        """Return the transforms that have changed by more than the thresholds since they were sent, by frame."""
        found, wanted = {}, asked.wanted
        for number, source in enumerate(wanted.source_frames, 1):
            if number % AT_ONCE == 0:
                await asyncio.sleep(0)
            now = self._tree.find(wanted.target_frame, source)
            if now is None:
                continue
            if (before := asked.last.get(source)) is not None:
                change = moved(before, now)
                if change.distance_m <= wanted.trans_thres and change.angle_rad <= wanted.angular_thres:
                    continue
            found[source] = now
        return found


def _stamped(target: str, transforms: Mapping[str, Transform]) -> list[dict[str, Any]]:
    secs, nsecs = divmod(time.time_ns(), 1_000_000_000)
    header = {"seq": 0, "stamp": {"secs": secs, "nsecs": nsecs}, "frame_id": target}
    return [
        {"header": header, "child_frame_id": source, "transform": msgspec.to_builtins(now)}
        for source, now in transforms.items()
    ]
