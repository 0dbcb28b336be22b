"""Messages that the holder publishes: checked, recorded, then sent once or at a rate until stopped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgspec

from robots.bridge.audit.records import RecordedTask, Requester, pop_due
from robots.bridge.tasks.input_routing import InputRouting
from robots.bridge.tasks.task import HALTED, WHILE_HELD, Context, Ending, TaskPart
from robots.shared import wire
from robots.shared.configuration.input_filters import COMMAND_LIFE_S
from robots.shared.messages import twists
from robots.shared.messages.type_names import bare
from robots.shared.records.record_sink import Parameters
from robots.shared.sentences import say
from robots.shared.wire import Grant, Refusal

NOT_SENT = Refusal(
    "inspector_silent", "The message was not published: the robot’s inspector ended. Ask again.", "robot"
)


@dataclass(eq=False)
class _Publication(RecordedTask):
    order: wire.Publish


class Publications(TaskPart):
    """The holder's publications, by topic."""

    kinds = (wire.PUBLISH,)
    reactions = WHILE_HELD

    def __init__(self, context: Context) -> None:
        self._context = context
        self._publisher = context.publisher
        self._records = context.records
        self._waiting: list[_Publication] = []  # for their records
        self._running: dict[str, _Publication] = {}  # at a rate

    # --- rules --------------------------------------------------------------------------------------

    def take(self, order: wire.Publish, grant: Grant, requester: Requester, now_s: float) -> None:
        """Check a message, then record it. A velocity goes through the gate at once."""
        if bare(order.type) in twists.TYPES:
            requester.answer(self._twist(order, grant, now_s))
            return
        rules = self._context.rules
        refusal = rules.why_not_begin(requester, now_s) or self._why_not(order)
        if refusal is not None:
            requester.answer(refusal)
            return

        def checked(refusal: Refusal | None, now_s: float) -> None:
            # Check again: control may have been lost, or stop pressed.
            refusal = refusal or rules.why_not_begin(requester, now_s)
            if refusal is None:
                self.begin(order, requester, now_s)
            else:
                requester.answer(refusal)

        self._publisher.check(order, checked)

    def _why_not(self, order: wire.Publish) -> Refusal | None:
        """Return a refusal if the allow-list does not have this topic and type."""
        wanted = ("publish", order.topic, bare(order.type))
        allowed = self._context.config.allowed
        if any((one.what, one.name, bare(one.type)) == wanted for one in allowed):
            return None
        text = say(
            "The allow-list does not contain {topic} with type {type}.", topic=order.topic, type=order.type
        )
        return Refusal("not_allowed", text, "robot", {"topic": order.topic, "type": order.type})

    def _twist(self, order: wire.Publish, grant: Grant, now_s: float) -> Refusal | None:
        """Pass a velocity through the gate.

        Only one topic takes velocities, and each velocity must be sent again in time.
        """
        routing = self._context.tasks.part(InputRouting)
        topic, type_name = routing.topic("drive"), routing.type("drive")
        if (order.topic, bare(order.type)) != (topic, bare(type_name)):
            text = say(
                "Publish velocities on {topic} as {type} only: they pass the gate there.",
                topic=topic,
                type=type_name,
            )
            return Refusal("around_the_gate", text, "gate", {"topic": topic, "type": type_name})
        if order.rate_hz:
            text = say(
                "A velocity is valid for {seconds} s: send it again yourself, without a rate.",
                seconds=COMMAND_LIFE_S,
            )
            return Refusal("dead_man", text, "dead-man")
        velocity = twists.velocity_from(order.fields, order.type)
        if isinstance(velocity, Refusal):
            return velocity
        return self._context.rules.twist(velocity, order, grant, now_s)

    # --- messages -----------------------------------------------------------------------------------

    def begin(self, order: wire.Publish, requester: Requester, now_s: float) -> None:
        """Record the request. When it is recorded, `tick` sends the message and answers the requester."""
        parameters: Parameters = {
            "topic": order.topic,
            "type": order.type,
            "rate_hz": order.rate_hz,
            "fields": msgspec.json.encode(order.fields).decode(),
        }
        number = self._records.request(requester.holder, wire.PUBLISH.record, parameters, now_s)
        self._waiting.append(_Publication(requester, number, now_s, order))

    def tick(self, now_s: float) -> None:
        for publishing in pop_due(self._waiting):
            refusal = publishing.unrecorded or self._context.rules.why_not_begin(publishing.requester, now_s)
            refusal = refusal or self._send(publishing, now_s)
            publishing.requester.answer(refusal)
            if refusal is not None:
                self._report_end(publishing, refusal.code, now_s)
        if self._running:
            self._publisher.keep_alive()

    def cancel_request(self, order: wire.PublishStop, why: str, now_s: float) -> Refusal | None:
        topic = order.topic
        if topic not in self._topics:
            return Refusal(
                "not_publishing", say("There is no publication at a rate on {topic}.", topic=topic), "robot"
            )
        self._deny("cancelled", Refusal("cancelled", why, "robot"), now_s, topic)
        self._end(topic, "cancelled", now_s)
        return None

    def drop(self, ending: Ending, now_s: float) -> None:
        self._deny(ending.refusal.code, ending.of_unbegun, now_s)

    def end_running(self, ending: Ending, now_s: float) -> None:
        self._halt(ending.refusal.code, now_s)

    def inspector_ended(self, now_s: float) -> None:
        """End all publications: the process that sends them ended."""
        self._deny("inspector_ended", HALTED, now_s)
        self._halt("inspector_ended", now_s)

    def _deny(self, outcome: str, refusal: Refusal, now_s: float, topic: str | None = None) -> None:
        """Refuse what waits: on this topic, or (None) on all."""
        denied = [publishing for publishing in self._waiting if topic in (None, publishing.order.topic)]
        self._waiting = [publishing for publishing in self._waiting if publishing not in denied]
        for publishing in denied:
            publishing.requester.answer(refusal)
            self._report_end(publishing, outcome, now_s)

    def _halt(self, outcome: str, now_s: float) -> None:
        self._publisher.halt()
        for topic in list(self._running):
            self._end(topic, outcome, now_s)

    @property
    def _topics(self) -> set[str]:
        """The topics of all publications, waiting or running."""
        return {*self._running, *(publishing.order.topic for publishing in self._waiting)}

    @property
    def under_way(self) -> list[str]:
        return [say("publishing on {topic}", topic=topic) for topic in sorted(self._topics)]

    def state(self, now_s: float) -> dict[str, Any]:
        return {"publishing": self._view}

    def headline(self, now_s: float) -> tuple[object, ...]:
        return tuple(self._view)

    @property
    def _view(self) -> list[wire.Publishing]:
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
        self._records.outcome(publishing, wire.PUBLISH.outcome, outcome, figures, now_s)
