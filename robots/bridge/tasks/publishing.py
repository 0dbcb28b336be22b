"""Messages that the holder publishes: checked, recorded, then sent once or at a rate until stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import msgspec

from robots import wire
from robots.bridge.audit.record_sink import Parameters
from robots.bridge.audit.records import RecordedTask, Records, Requester, pop_due
from robots.wire import Refusal

NOT_SENT = Refusal(
    "inspector_silent", "The message was not published: the robot’s inspector ended. Ask again.", "robot"
)
HALTED = Refusal(
    "halted", "It was not done: control ended or the robot was stopped before it was recorded.", "robot"
)


class Publisher(Protocol):
    """Sends messages of any type."""

    def check(self, order: wire.Publish, then: Callable[[Refusal | None, float], None]) -> None:
        """Check the fields against the type's definition; call `then` once, with a refusal or None, and the time."""

    def publish(self, order: wire.Publish) -> bool:
        """Send once, or at a rate instead of an earlier message on this topic. Return False if it is not sent."""

    def publish_stop(self, topic: str) -> None:
        """Stop sending on this topic."""

    def halt(self) -> None:
        """Drop all messages given so far: those sent at a rate, and those that wait for subscribers."""

    def keep_alive(self) -> None:
        """Allow sending at a rate to continue. Call it every tick: sending pauses without it."""


@dataclass(eq=False)
class _Publication(RecordedTask):
    order: wire.Publish


class Publications:
    """The holder's publications, by topic."""

    def __init__(self, publisher: Publisher, records: Records) -> None:
        self._publisher = publisher
        self._records = records
        self._waiting: list[_Publication] = []  # for their records
        self._running: dict[str, _Publication] = {}  # at a rate

    def begin(self, order: wire.Publish, requester: Requester, now_s: float) -> None:
        """Record the request. When it is recorded, `tick` sends the message and answers the requester."""
        parameters: Parameters = {
            "topic": order.topic,
            "type": order.type,
            "rate_hz": order.rate_hz,
            "fields": msgspec.json.encode(order.fields).decode(),
        }
        number = self._records.request(requester.holder, "publish.start", parameters, now_s)
        self._waiting.append(_Publication(requester, number, now_s, order))

    def tick(self, why_not: Callable[[Requester, float], Refusal | None], now_s: float) -> None:
        """Send recorded messages. Drop one if its record failed or if a rule now forbids it."""
        for publishing in pop_due(self._waiting):
            refusal = publishing.unrecorded or why_not(publishing.requester, now_s)
            refusal = refusal or self._send(publishing, now_s)
            publishing.requester.answer(refusal)
            if refusal is not None:
                self._report_end(publishing, refusal.code, now_s)
        if self._running:
            self._publisher.keep_alive()

    def stop(self, topic: str, now_s: float) -> Refusal | None:
        """End the holder's publication on a topic."""
        if topic not in self._running:
            return Refusal("not_publishing", f"There is no publication at a rate on {topic}.", "robot")
        self._end(topic, "cancelled", now_s)
        return None

    def halt(self, why: str, now_s: float, refusal: Refusal = HALTED) -> None:
        """End all publications and drop waiting messages; `refusal` answers their requesters."""
        self._publisher.halt()
        self.deny(why, now_s, refusal)
        for topic in list(self._running):
            self._end(topic, why, now_s)

    def deny(self, why: str, now_s: float, refusal: Refusal) -> None:
        """Drop messages that wait for their record."""
        waiting, self._waiting = self._waiting, []
        for publishing in waiting:
            publishing.requester.answer(refusal)
            self._report_end(publishing, why, now_s)

    @property
    def under_way(self) -> list[str]:
        """Publications at a rate and waiting messages, in words."""
        topics = {*self._running, *(publishing.order.topic for publishing in self._waiting)}
        return [f"publishing on {topic}" for topic in sorted(topics)]

    @property
    def view(self) -> list[wire.Publishing]:
        """Publications at a rate, for pages."""
        return [
            wire.Publishing(topic, publishing.order.type, publishing.order.rate_hz)
            for topic, publishing in self._running.items()
        ]

    def _send(self, publishing: _Publication, now_s: float) -> Refusal | None:
        topic = publishing.order.topic
        self._end(topic, "replaced", now_s)
        if not self._publisher.publish(publishing.order):
            return NOT_SENT
        if publishing.order.rate_hz:
            self._running[topic] = publishing
        else:
            self._report_end(publishing, "sent", now_s)
        return None

    def _end(self, topic: str, outcome: str, now_s: float) -> None:
        publishing = self._running.pop(topic, None)
        if publishing is not None:
            self._publisher.publish_stop(topic)
            self._report_end(publishing, outcome, now_s)

    def _report_end(self, publishing: _Publication, outcome: str, now_s: float) -> None:
        """Record the end."""
        figures: Parameters = {
            "topic": publishing.order.topic,
            "duration_s": round(now_s - publishing.since_s, 2),
        }
        self._records.outcome(publishing, "publish.end", outcome, figures, now_s)
