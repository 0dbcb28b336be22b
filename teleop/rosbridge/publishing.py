"""Messages of a client: velocities go through the gate by the shortest way, others by the allow-list."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import msgspec
from msgspec import Struct

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.messages import twists
from robots.shared.messages.type_names import bare
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal, TaskRequest, WireError
from teleop.background.jobs import run_in_background
from teleop.control.allowed.allow_list import check_role, required_role
from teleop.control.lease_checks import NO_LEASE
from teleop.live.robot_hub import RobotHub
from teleop.rosbridge.family import Client, Family, Handler
from teleop.rosbridge.operations import (
    Advertise,
    Id,
    Operation,
    Publish,
    Unadvertise,
    full_name,
    full_type,
    twist_of,
)

VELOCITY_TOPIC = "/cmd_vel"  # where clients expect it; the robot's own drive topic is the same here
MOST_TOPICS = 100  # advertised by one client
_TWIST, _STAMPED = twists.TYPES

# Which client advertises which type: of all clients of a robot in this process
_advertised: WeakKeyDictionary[RobotHub, dict[str, dict[str, str]]] = WeakKeyDictionary()


class _Order(Struct, frozen=True, tag_field="t", tag="publish"):
    """A `wire.Publish` of a velocity, which the bridge checks."""

    fence: int
    topic: str
    type: str
    fields: Any
    sent_ms: float
    seq: int


class _Velocity(Struct, frozen=True, tag_field="t", tag="velocity"):
    """A `wire.LinkVelocity`."""

    order: _Order


class Publishing(Family):
    """The topics that a client advertises, and its messages."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._types: dict[str, str] = {}  # of advertised topics
        self._ids: dict[
            str, set[Id]
        ] = {}  # of their advertisements: one client may have several of one topic
        self._here = _advertised.setdefault(client.hub, {})

    def handlers(self) -> Mapping[type[Operation], Handler]:
        return {Advertise: self._advertise, Unadvertise: self._unadvertise, Publish: self._publish}

    def leave(self) -> None:
        for topic in list(self._types):
            self._forget(topic)

    # --- topics ----------------------------------------------------------------------------------------

    async def _advertise(self, operation: Advertise) -> None:
        topic, type_ = full_name(operation.topic), full_type(operation.type)
        if len(self._types) >= MOST_TOPICS and topic not in self._types:
            text = say("A client may advertise at most {most} topics.", most=MOST_TOPICS)
            raise NotDone(Refusal("too_many_topics", text, "wire", {"most": MOST_TOPICS}))
        is_console = self._takes(topic) is not None or topic in self._drive_topics
        # Only on topics of the robot a client may keep another from its type
        others = {} if is_console else self._here.get(topic, {})
        if other := next(
            (known for key, known in others.items() if key != self.client.id and known != type_), None
        ):
            raise NotDone(_other_type(topic, other))
        if refusal := self._why_not(topic, type_):
            raise NotDone(refusal)
        self._types[topic] = type_
        if len(ids := self._ids.setdefault(topic, set())) < MOST_TOPICS:
            ids.add(operation.id)
        self._here.setdefault(topic, {})[self.client.id] = type_

    async def _unadvertise(self, operation: Unadvertise) -> None:
        topic = full_name(operation.topic)
        if topic in self._types:
            ids = self._ids[topic]
            ids.discard(operation.id)
            if operation.id is None or not ids:
                self._forget(topic)
        else:
            text = say("This client does not advertise {topic}.", topic=topic)
            await self.client.status("warning", f"not_advertised: {text}", operation.id)

    def _forget(self, topic: str) -> None:
        del self._types[topic], self._ids[topic]
        if clients := self._here.get(topic):
            clients.pop(self.client.id, None)
            if not clients:
                del self._here[topic]

    def _why_not(self, topic: str, type_: str) -> Refusal | None:
        """Return why this person may not publish here; control is checked with each message."""
        if self._takes(topic) is not None:
            return None
        if topic in self._drive_topics:
            drives = type_ in (bare(self._drive_type), _TWIST)
            return None if drives else _other_type(topic, self._drive_type)
        allowed = self.client.hub.entry.allowed
        types = [one.type for one in allowed if (one.what, one.name) == ("publish", topic)]
        if types and type_ not in map(bare, types):
            return _other_type(topic, types[0])
        return check_role(self.client.rights, required_role(allowed, "publish", topic, type_), topic)

    def _takes(self, topic: str) -> Handler | None:
        """Return what takes messages on this topic in place of the robot."""
        return next(filter(None, (family.publisher(topic) for family in self.client.families)), None)

    # --- velocities ---------------------------------------------------------------------------------------

    @property
    def _drive_topic(self) -> str:
        """The topic on which the robot takes velocities now."""
        link = self.client.hub.link
        chosen = link.state.chosen.get("drive") if link.state else None
        return chosen or self.client.hub.entry.facts.drive_topic

    @property
    def _drive_topics(self) -> tuple[str, ...]:
        return VELOCITY_TOPIC, self.client.hub.entry.facts.drive_topic, self._drive_topic

    @property
    def _drive_type(self) -> str:
        offers = self.client.hub.link.offers
        return offers.uses["drive"].type if offers and "drive" in offers.uses else _TWIST

    def drives(self, operation: Operation) -> bool:
        """Return whether this is a velocity."""
        return isinstance(operation, Publish) and full_name(operation.topic) in self._drive_topics

    def at_once(self, raw: str) -> bool:
        """Forward a velocity of the holder by the lane. False: it is something else, or needs an answer."""
        link, began_s = self.client.hub.link, time.perf_counter()
        if not link.has_lane or '"publish"' not in raw[:40] or not self.client.opens(Scope.DRIVE):
            return False
        try:
            twist = twist_of(raw)
        except WireError:
            return False
        if full_name(twist.topic) not in self._drive_topics or not self.client.spend():
            return False
        was_sent = link.forward_by_lane(_encoded(self._order(twist.topic, twist.msg)))
        self.client.forwarded(was_sent, began_s)
        return True

    def _order(self, topic: str, fields: Any) -> _Order:
        """Return a velocity for the bridge. Clients send no time: it counts as sent when it arrives."""
        wanted = self._drive_type
        type_ = self._types.get(full_name(topic), bare(wanted))
        if (type_, bare(wanted)) == (_TWIST, _STAMPED):
            type_, fields = _STAMPED, {"twist": fields}
        type_ = wanted if type_ == bare(wanted) else type_
        fence, sent_ms = self.client.fence or 0, 1000.0 * time.monotonic()
        return _Order(fence, self._drive_topic, type_, fields, sent_ms, self.client.next_number())

    async def stand(self) -> None:
        """Send a velocity of zero."""
        await self.client.hub.link.forward(_encoded(self._order(VELOCITY_TOPIC, {})))

    # --- messages -------------------------------------------------------------------------------------------

    async def _publish(self, operation: Publish) -> None:
        topic = full_name(operation.topic)
        if takes := self._takes(topic):
            await takes(operation)
        elif topic in self._drive_topics:
            await self._drive(operation)
        else:
            type_ = self._type_of(topic)
            make = partial(_message, topic, type_, operation.msg)
            run_in_background(self._request(operation, make))

    async def _drive(self, operation: Publish) -> None:
        self.client.require(Scope.DRIVE)
        if self.client.fence is None:
            raise NotDone(NO_LEASE)
        order = self._order(operation.topic, operation.msg)
        wire.browser_message(_encode(order))  # of what the bridge cannot read, it could not say whose it was
        began_s = time.perf_counter()
        self.client.forwarded(await self.client.hub.link.forward(_encoded(order)), began_s)

    def _type_of(self, topic: str) -> str:
        """Return the type of a message: as advertised, else as on the allow-list. Raises `NotDone`."""
        if topic in self._types:
            return self._types[topic]
        allowed = self.client.hub.entry.allowed
        found = next((one.type for one in allowed if (one.what, one.name) == ("publish", topic)), None)
        if found is None:
            text = say("{name} is not on the allow-list for this. Ask the staff.", name=topic)
            raise NotDone(Refusal("not_allowed", text, "robot", {"name": topic}))
        return found

    async def _request(self, operation: Publish, make: Callable[[int, int], TaskRequest]) -> None:
        try:
            await self.client.request(make)
        except NotDone as refused:
            await self.client.refuse("publish", refused.refusal, operation.id)


def _message(topic: str, type_: str, fields: dict[str, Any], fence: int, number: int) -> wire.Publish:
    return wire.Publish(fence, topic, type_, fields, seq=number)


def _other_type(topic: str, type_: str) -> Refusal:
    text = say("{topic} has the type {type}.", topic=topic, type=type_)
    return Refusal("other_type", text, "wire", {"topic": topic, "type": type_})


_encode = msgspec.json.Encoder().encode


def _encoded(order: _Order) -> str:
    return _encode(_Velocity(order)).decode()
