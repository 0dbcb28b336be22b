"""Handles each request of the bridge: a query, a subscription, a message to the robot, or a halt.

The inspector refuses publications, calls and parameters that the denylist (`robots/shared/configuration/denylist.py`)
forbids.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import msgspec

from robots.bridge.robot_clock import RobotClock
from robots.bridge.topics.inspector import calls, parameters
from robots.bridge.topics.inspector.declined import Declined
from robots.bridge.topics.inspector.publishing import Publishers, PublishPermit
from robots.bridge.topics.inspector.side import InspectorSide, Node
from robots.bridge.topics.inspector.subscriptions import Subscriptions
from robots.bridge.topics.inspector_messages import (
    Check,
    Done,
    FollowClock,
    HaltPublishing,
    InspectorQuery,
    KeepAlive,
    Report,
    Request,
    TooLate,
)
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.denylist import (
    admissible,
    names_set,
    why_denied,
    why_fields_denied,
)
from robots.shared.messages.definition import Definition
from robots.shared.messages.fields import BadField, fit_fields
from robots.shared.messages.packing import Broken, TooLarge
from robots.shared.messages.type_names import bare
from robots.shared.sentences import reason_of, say
from robots.shared.unreachable import Unreachable

log = logging.getLogger(__name__)

MOST_QUESTIONS = 32  # at once: as many as a web process asks
LARGEST_ANSWER = 1024 * 1024  # bytes; the bridge accepts longer lines

_request = msgspec.json.Decoder(Request)


class _Joined(NamedTuple):
    """The node with what it subscribes and publishes."""

    node: Node
    subscriptions: Subscriptions
    publishers: Publishers


class Inspector:
    """Answers the bridge's requests."""

    def __init__(self, config: BridgeConfig, side: InspectorSide, say: Callable[[bytes], None]) -> None:
        self._config = config
        self._side = side
        self._allowed = admissible(config.allowed, config.topics)
        self._say = say
        self._room = threading.BoundedSemaphore(MOST_QUESTIONS)
        self._work: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._joined: _Joined | None = None
        self._clock = RobotClock()
        self._permit = PublishPermit()  # to publish, until the next halt
        # by topic and type: the definition at the last check
        self._checked: dict[tuple[str, str], Definition] = {}

    def handle_line(self, line: bytes) -> None:
        """Handle one request. Returns at once, so that a halt and the end of stdin are read without delay."""
        self._permit.heard()
        match _request.decode(line):
            case InspectorQuery() as question:
                self._aside(partial(self._answer, question))
            case Check(number=number, order=order):
                self._aside(partial(self._check, number, order))
            case wire.LinkSubscribe(topics=topics):
                self._work.put(partial(self._subscribe, topics))
            case wire.Publish() as order:
                self._work.put(partial(self._publish, order, self._permit))
            case HaltPublishing(number=number, topic=None):
                self._halt(number)
            case HaltPublishing(number=number, topic=str(topic)):
                self._work.put(partial(self._stop_publishing, number, topic))
            case FollowClock(clock=clock):
                self._work.put(partial(self._follow_clock, clock))
            case KeepAlive():
                pass  # its arrival already extended the permit

    def run(self) -> None:
        """Run the requests that use the node, one after the other."""
        while True:
            self._work.get()()

    def close(self) -> None:
        """Leave the robot."""
        if self._joined is not None:
            self._joined.node.leave()

    # --- requests that use the node --------------------------------------------------------------

    def _join(self) -> _Joined:
        """Return the node; create it at first use, because most queries need none."""
        if self._joined is None:
            node = self._side.join()
            subscriptions = Subscriptions(node, self._sample)
            subscriptions.clock = self._clock
            self._joined = _Joined(node, subscriptions, Publishers(node))
        return self._joined

    def _follow_clock(self, clock: RobotClock) -> None:
        self._clock = clock
        if self._joined is not None:
            self._joined.subscriptions.clock = clock

    def _subscribe(self, topics: dict[str, float]) -> None:
        if not topics and self._joined is None:
            return
        try:
            self._join().subscriptions.set_subscriptions(topics)
        except (OSError, Unreachable) as error:
            refusal = wire.Refusal("robot_offline", reason_of(error), "robot")
            for topic in topics:
                sample = wire.Sample(topic, "*", 0, None, 0, None, 0, {}, refusal=refusal)
                self._sample(topic, wire.encode(sample))
            raise

    def _publish(self, order: wire.Publish, permit: PublishPermit) -> None:
        # The order passed a `Check`, maybe in an earlier process. A fault ends this process; the bridge
        # reports that.
        definition = self._checked.get((order.topic, order.type)) or self._sendable(order)
        values = fit_fields(definition.fields, order.fields)
        self._join().publishers.publish(
            order.topic, definition, lambda: definition.layout.write(values, _now()), permit, order.rate_hz
        )

    def _halt(self, number: int) -> None:
        """Drop all messages that still wait to be published."""
        ended, self._permit = self._permit, PublishPermit()
        ended.withdraw()
        self._report(Done(number))

    def _stop_publishing(self, number: int, topic: str) -> None:
        if self._joined is not None:
            self._joined.publishers.stop(topic)
        self._report(Done(number))

    # --- reports --------------------------------------------------------------------------------------

    def _report(self, report: Report) -> None:
        self._say(wire.encode(report))

    def _sample(self, topic: str, sample: bytes) -> None:
        self._report(wire.LinkSample(topic, msgspec.Raw(sample)))

    # --- queries --------------------------------------------------------------------------------------

    def _aside(self, work: Callable[[], None]) -> None:
        """Run on a separate thread, since it may take a second. If all are busy, there is no answer."""

        def run() -> None:
            try:
                work()
            finally:
                self._room.release()

        if self._room.acquire(blocking=False):
            threading.Thread(target=run, daemon=True).start()
        else:
            log.warning("more than %s queries at once: one is not answered", MOST_QUESTIONS)

    def _answer(self, question: InspectorQuery) -> None:
        ask = question.ask
        try:
            answer = wire.encode(self._answered(question))
            if len(answer) > LARGEST_ANSWER:
                text = say("The answer has {size} bytes: too many to be shown.", size=len(answer))
                raise Declined("too_large", text, bytes=len(answer), limit_bytes=LARGEST_ANSWER)
        except Exception as error:  # noqa: BLE001  (every query gets an answer)
            answer = wire.encode(wire.Refused(wire.kind_of(ask), _refusal(error), ask.seq))
        self._report(wire.LinkAnswer(question.seq, msgspec.Raw(answer)))

    def _answered(self, question: InspectorQuery) -> wire.DoorAnswer:
        question.require_time()
        side = self._side
        match question.ask:
            case wire.ListTopics(seq=seq):
                return side.graph(seq)
            case wire.Describe(type=type_name, topic=topic, seq=seq):
                return _described(side.definition(type_name, topic), seq)
            case wire.DescribeService(service=name, seq=seq):
                return _described(side.service(name).request, seq)
            case wire.ListParameters(seq=seq):
                return parameters.names(side, seq)
            case wire.GetParameter(name=name, seq=seq, whole=whole):
                return parameters.parameter(side, name, seq, whole)
            case wire.SetParameter(name=name, value=value, seq=seq):
                self._require("set", name)
                self._require_admissible(name, value)
                side.set_parameter(name, value, question.require_time)
                return parameters.parameter(side, name, seq)
            case wire.CallService(service=name, fields=fields, seq=seq, whole=whole):
                service = side.service(name)
                self._require("call", name, service.type)
                detail = None if whole else calls.SHOWN
                called, shortened = calls.call(side.call, service, fields, question.require_time, detail)
                return wire.Called(name, called, seq, shortened)
            case door:
                return self._answered_door(door, question.require_time)

    def _answered_door(self, ask: wire.DoorQuery, require_time: Callable[[], None]) -> wire.DoorAnswer:
        side = self._side
        match ask:
            case wire.ListServiceTypes(services=names, seq=seq):
                return wire.ServiceTypes(side.service_types(names), seq)
            case wire.LocateService(service=name, seq=seq):
                return wire.ServiceHost(side.service_host(name), seq)
            case wire.DescribeServiceType(type=type_name, response=response, seq=seq):
                return _described(side.service_part(type_name, response), seq)
            case wire.ListDefinitions(seq=seq):
                return wire.Definitions(side.texts(), seq)
            case wire.GetAllParameters(seq=seq):
                return parameters.everything(side, seq)
            case wire.DeleteParameter(name=name, seq=seq):
                self._require("set", name)
                self._require_admissible(name, None)
                parameters.require(side, name)
                side.delete_parameter(name, require_time)
                return wire.Parameter(name, None, seq)
            case wire.GetTime(seq=seq):
                now_ns = time.time_ns() + round(1e9 * (self._clock.skew_s or 0.0))
                return wire.RobotTime(*divmod(now_ns, 1_000_000_000), seq)

    def _require(self, what: str, name: str, type_name: str = "") -> None:
        """Refuse names that are not on the allow-list. Web process and bridge have checked the person."""
        wanted = (what, name, bare(type_name))
        if not any((allowed.what, allowed.name, bare(allowed.type)) == wanted for allowed in self._allowed):
            text = {
                "set": say("It is not allowed to set {name}: it is not on the allow-list.", name=name),
                "call": say(
                    "It is not allowed to call {name} as {type}: it is not on the allow-list.",
                    name=name,
                    type=type_name,
                ),
                "publish": say(
                    "It is not allowed to publish {name} as {type}: it is not on the allow-list.",
                    name=name,
                    type=type_name,
                ),
            }[what]
            raise Declined("not_allowed", text, name=name, type=type_name)

    def _require_admissible(self, name: str, value: object) -> None:
        """Refuse to set or overwrite a branch that contains an inadmissible parameter."""
        for inner in names_set(name, value, self._side.parameter(name)):
            if why := why_denied("set", inner, "", self._config.topics):
                raise Declined(
                    "not_allowed",
                    say("It is not allowed to set {name}: {why}.", name=inner, why=why),
                    name=inner,
                )

    def _sendable(self, order: wire.Publish) -> Definition:
        """Return the definition of an allowed message. Raises Declined if it is not allowed, or harmful."""
        self._require("publish", order.topic, order.type)
        definition = self._side.definition(order.type, order.topic)
        self._require_harmless(definition)
        return definition

    def _require_harmless(self, definition: Definition) -> None:
        """Refuse types that contain a twist under any name: check inner types and their content. Raises Declined."""
        why = why_fields_denied(definition.type, definition.fields)
        if twin := self._side.imitated(definition):
            why = why_fields_denied(twin, ())
        if why:
            text = say("It is not allowed to publish {type}: {why}.", type=definition.type, why=why)
            raise Declined("not_allowed", text, type=definition.type)

    def _check(self, number: int, order: wire.Publish) -> None:
        try:
            definition = self._sendable(order)
            definition.layout.write(fit_fields(definition.fields, order.fields), _now())
            self._checked[order.topic, order.type] = definition
            refusal = None
        except Exception as error:  # noqa: BLE001  (as above)
            refusal = _refusal(error)
        self._report(Done(number, refusal))


def _refusal(error: Exception) -> wire.Refusal:
    match error:
        case BadField() | Declined():
            return error.refusal
        case TooLate():
            return wire.Refusal("too_old", "The request is too old: nothing was done.", "robot")
        case TooLarge():
            return wire.Refusal("too_large", reason_of(error), "robot")
        case Unreachable() | OSError():
            return wire.Refusal("robot_offline", reason_of(error), "robot")
        case Broken():
            return wire.Refusal("broken", reason_of(error), "robot")
        case _:
            log.error("a query failed", exc_info=error)
            return wire.Refusal("inspector_fault", "The inspector failed at this; its log says how.", "robot")


def _described(definition: Definition, seq: int) -> wire.Described:
    return wire.Described(
        definition.type, definition.md5, definition.fields, definition.text, definition.known, seq
    )


def _now() -> tuple[int, int]:
    secs, nsecs = divmod(time.time_ns(), 1_000_000_000)
    return secs, nsecs
