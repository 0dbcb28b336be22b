"""The topics that a client reads, each at its own rate and in its own form, from the robot's tap."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.link.tap_link import STARTING
from robots.shared.sentences import say
from robots.shared.wire import MOST_QUEUED, Form, Level, NotDone, Refusal, TapState
from teleop.background.jobs import run_in_background
from teleop.records.camera_audit import TOO_MANY_CAMERAS, CameraAudit, is_picture
from teleop.rosbridge import framing
from teleop.rosbridge.family import Client, Family, Handler
from teleop.rosbridge.operations import Id, Number, Operation, Subscribe, Unsubscribe, full_name, full_type
from teleop.tap.feed import MOST_READINGS, TOO_MANY_READINGS, TapMessage, TapReader, feed_of

CONSOLE = "/fleet/"  # topics of the console's own, which no tap reads
MOST_IDS = 100  # subscriptions of one topic by one client
_FORMS: dict[str, Form] = {"cbor-raw": "raw", "cbor": "cbor", "png": "json", "none": "json"}  # the first wins


# Id and type. Two types under one id are two subscriptions: the wrong one must not replace the right one
_Key = tuple[Id, str | None]


class _Topic:
    """All subscriptions of one topic by one client: it gets each message once."""

    def __init__(self) -> None:
        self.wanted: dict[_Key, Subscribe] = {}
        self.type = ""  # as its publishers say
        self.told = ""  # code of the last refusal that the client was told

    def settle(self) -> None:
        """Find how the messages are sent: as the most demanding subscription wants it."""
        wanted = list(self.wanted.values())
        kinds = {one.compression or "none" for one in wanted}
        self.compression = next(kind for kind in _FORMS if kind in kinds)
        self.form = _FORMS[self.compression]
        self.every_s = min(one.throttle_rate or 0.0 for one in wanted) / 1000.0
        self.queue = int(min(max(one.queue_length or 0 for one in wanted), MOST_QUEUED))
        sizes = [one.fragment_size for one in wanted if one.fragment_size]
        self.fragment_size = int(min(min(sizes), 2**40)) if sizes else None
        self.names = list(dict.fromkeys(one.topic for one in wanted))


class Subscribing(Family):
    """The subscriptions of one client."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._topics: dict[str, _Topic] = {}
        self._cameras = CameraAudit(client.user, client.hub.robot_id, client.hub.entry.facts.name)
        self._sending = 0  # messages that are encoded or sent in the background
        self._reader: TapReader | None = None

    def handlers(self) -> Mapping[type[Operation], Handler]:
        return {Subscribe: self._subscribe, Unsubscribe: self._unsubscribe}

    def leave(self) -> None:
        self._topics.clear()
        self._cameras.end_all()
        if self._reader:
            self._reader.leave()

    # --- operations ------------------------------------------------------------------------------------

    async def _subscribe(self, operation: Subscribe) -> None:
        self.client.require(Scope.TOPICS)
        for field in ("throttle_rate", "queue_length", "fragment_size"):
            _require_amount(field, getattr(operation, field))
        name = full_name(operation.topic)
        topic = self._topics.get(name) or _Topic()
        key = operation.id, operation.type and full_type(operation.type)
        if key not in topic.wanted and len(topic.wanted) >= MOST_IDS:
            text = say("A client may subscribe to one topic at most {most} times.", most=MOST_IDS)
            raise NotDone(Refusal("too_many_subscriptions", text, "limits", {"limit": MOST_IDS}))
        if refusal := _other_type(operation, topic.type):
            raise NotDone(refusal)
        before = dict(topic.wanted)
        topic.wanted[key] = operation
        if refusal := self._read(name, topic):
            topic.wanted = before
            if before:
                topic.settle()
            raise NotDone(refusal)
        if (operation.queue_length or 0) > MOST_QUEUED:
            text = say("At most {most} messages of a topic wait for a client.", most=MOST_QUEUED)
            await self.client.status("warning", f"limited: {text}", operation.id)
        for family in self.client.families:
            await family.subscribed(name)

    def _read(self, name: str, topic: _Topic) -> Refusal | None:
        """Read a topic, new or with other subscriptions than before."""
        if self._reader is None:
            client = self.client
            self._reader = TapReader(
                feed_of(client.hub.link), self._deliver, self._follow, self._is_behind, client.user.pk
            )
        is_new = name not in self._topics
        form_before = None if is_new else topic.form
        topic.settle()
        self._topics[name] = topic
        if form_before not in (None, topic.form):  # first: with the new one, it could be one too many
            self._reader.end(name, form_before)
        if name.startswith(CONSOLE):
            refusal = TOO_MANY_READINGS if len(self._topics) > MOST_READINGS else None
        else:
            refusal = self._reader.read(name, topic.form, topic.every_s, max(1, topic.queue))
        if refusal is not None and is_new:
            del self._topics[name]
        return refusal

    async def _unsubscribe(self, operation: Unsubscribe) -> None:
        name = full_name(operation.topic)
        topic = self._topics.get(name)
        ended = [key for key in topic.wanted if operation.id in (None, key[0])] if topic else []
        if not ended:
            text = say("This client does not subscribe to {topic}.", topic=name)
            await self.client.status("warning", f"not_subscribed: {text}", operation.id)
            return
        self._end(name, ended)

    def _end(self, name: str, ended: Iterable[_Key]) -> None:
        """End these subscriptions of a topic."""
        topic = self._topics[name]
        for key in ended:
            topic.wanted.pop(key, None)
        if topic.wanted:
            self._read(name, topic)
            return
        del self._topics[name]
        self._cameras.end_viewing(name)
        if self._reader:
            self._reader.end(name, topic.form)

    # --- messages ------------------------------------------------------------------------------------------

    def _follow(self, state: TapState) -> None:
        """Follow what the topic's publishers say of it."""
        if (topic := self._topics.get(state.topic)) is None:
            return
        topic.type = state.type or topic.type
        if (refusal := state.refusal) is not None and refusal.code != topic.told:
            level: Level = "info" if refusal == STARTING else "warning"
            run_in_background(self.client.status(level, refusal.coded_text))
        topic.told = refusal.code if refusal else ""
        refused = {key: _other_type(one, topic.type) for key, one in topic.wanted.items()}
        wrong = {key: other for key, other in refused.items() if other}
        for (id_, _), other in wrong.items():
            run_in_background(self.client.refuse("subscribe", other, id_))
        if wrong:
            self._end(state.topic, wrong)

    def _is_behind(self) -> bool:
        return self._sending > 0 or self.client.is_behind()

    async def _deliver(self, name: str, form: Form, message: TapMessage) -> None:
        topic = self._topics.get(name)
        # Without its type nobody knows whether it is a picture, which must be recorded
        if topic is None or topic.form != form or not topic.type:
            return
        if is_picture(topic.type) and not self._cameras.begin_or_continue(name):
            await self.client.refuse("subscribe", TOO_MANY_CAMERAS)
            return
        for spelt in topic.names:
            if form == "raw":
                await self.client.send(framing.as_cbor_raw(spelt, message.body, message.stamp_ns))
            elif form == "cbor":
                await self.client.send(framing.as_cbor(spelt, message.body))
            elif topic.compression == "none" and topic.fragment_size is None:
                await self.client.send_text(framing.as_text(spelt, message.body))
            else:
                self._sending += 1
                run_in_background(self._send_slowly(topic, spelt, message.body))

    async def _send_slowly(self, topic: _Topic, name: str, body: bytes) -> None:
        """Send a message as a picture or in fragments. Meanwhile the next ones wait, and the newest wins."""
        try:
            await self.client.send_as(framing.as_text(name, body), topic.compression, topic.fragment_size)
        finally:
            self._sending -= 1

    async def show(self, topic: str, message: Mapping[str, Any]) -> bool:
        if (known := self._topics.get(topic)) is None:
            return False
        told = [{"op": "publish", "topic": name, "msg": message} for name in known.names]
        return all([await self.client.pass_on(one) for one in told])


def _require_amount(field: str, amount: Number) -> None:
    if amount is not None and not (math.isfinite(amount) and amount >= 0):
        text = say("{field} is not a number from 0 on.", field=field)
        raise NotDone(Refusal("invalid", text, "wire", {"field": field}))


def _other_type(operation: Subscribe, type_: str) -> Refusal | None:
    """Return why this subscription gets nothing: the topic has another type than it expects."""
    if not type_ or operation.type is None or full_type(operation.type) == full_type(type_):
        return None
    text = say("{topic} has the type {type}.", topic=full_name(operation.topic), type=type_)
    return Refusal("other_type", text, "wire", {"topic": full_name(operation.topic), "type": type_})
