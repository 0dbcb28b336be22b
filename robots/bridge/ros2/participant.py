"""This process in the robot's domain: one context, one node, one executor on a thread of its own."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial, wraps
from typing import Any

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from robots.bridge.robot.board import BOARD
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.qos import ONE_ANSWER
from robots.bridge.ros2.sizes import most_bytes
from robots.bridge.ros2.versions import Versions
from robots.shared.processes.memory import end_without_memory
from robots.shared.processes.vital import start_vital
from robots.shared.sentences import say
from robots.shared.texts import size_text
from robots.shared.unreachable import Unreachable

log = logging.getLogger(__name__)

LOOK_S = 0.02  # between looks for a service
WORKED_S = 10.0  # an executor that ran for so long works
MOST_FAILURES = 20  # in a row

# The survey tells of QoS that does not fit. rclpy's own handlers fail when a subscription ends on another thread.
NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)

NO_SERVICES = [
    Parameter("start_type_description_service", value=False)
]  # beside those that Node is asked for
# A subscription of another type has not ended yet: the executor looks at it. A moment later one can be made.
TypeInUse = rclpy_implementation.RCLError
_END = partial(os._exit, 1)  # a process that hears nothing more must not seem to live

Take = Callable[[bytes, Any], None]


class _AllAtOnce(ReentrantCallbackGroup):  # type: ignore[misc]
    """Lets each callback run: one thread runs them all.

    rclpy's own group lets none run any more once a message could not be taken, and never forgets what was in it.
    """

    def add_entity(self, entity: Any) -> None:
        """Do nothing."""


class _Executor(SingleThreadedExecutor):  # type: ignore[misc]
    """Goes on when an answer of a service cannot be read: a stranger may send any number of them."""

    def _take_client(self, client: Any) -> Any:
        try:
            return super()._take_client(client)
        except MemoryError:
            raise
        except Exception:
            log.debug("an answer of %s could not be read", client.srv_name, exc_info=True)
            return None


class Silent(Unreachable):
    """A service that has the request does not answer."""


class Participant:
    """A node that nobody outside can move, shut down or reconfigure: it has no services and reads no arguments.

    If its executor fails again and again, the process ends, or does what `on_failed` says. With `rests` it reads in
    batches, and leaves messages in their queues for so long (s): rclpy builds its wait set anew after each batch, which
    costs more than a message, and keeps the event loop from sending a twist meanwhile.
    """

    def __init__(
        self,
        name: str,
        domain: int,
        on_failed: Callable[[], None] = _END,
        rests: Callable[[], float] | None = None,
    ) -> None:
        self._context = Context()
        self._on_failed = on_failed
        self._rests = rests
        self._reads = threading.Event()  # now, instead of a rest
        self._closing = False
        rclpy.init(
            args=[],
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = Node(
            name,
            context=self._context,
            cli_args=[],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=NO_SERVICES,
        )
        self.node._default_callback_group = _AllAtOnce()
        # The EventsExecutor of Kilted needs less, but hands over one message of a raw subscription and then none.
        self._executor = _Executor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="ros2", daemon=True)

    def start(self) -> None:
        """Call the callbacks of subscriptions from now on."""
        self._thread.start()

    def work(self, work: Callable[[], None], name: str) -> None:
        """Run what the process needs on a thread, until this participant is closed."""

        def until_closed() -> None:
            try:
                work()
            except InvalidHandle:
                if not self._closing:
                    raise

        start_vital(until_closed, name)

    def read_soon(self) -> None:
        """End a rest: the next one begins after a read. Thread-safe."""
        self._reads.set()

    def listen(
        self,
        topic: str,
        kind: str | type[Any],
        take: Take,
        qos: QoSProfile,
        largest: int | None = None,
        *,
        any_version: bool = False,
    ) -> Subscription:
        """Give `take` the bytes of each message, with what is known about it. Raises TypeUnknown.

        Larger messages than the console reads are dropped: DDS cuts nobody off, but decoding is what costs.
        `largest`: bytes of the largest one, if it does not follow from the type. Those of a publisher whose type has
        other fields than the one here are dropped, too, unless `any_version`: their values would be wrong.
        Raises TypeInUse, if this process has just read the topic with another type.
        """
        name = kind if isinstance(kind, str) else ""
        most = most_bytes(name) if largest is None else largest
        versions = Versions(self.node, topic, name) if name and not any_version else None

        @guarded
        def receive(raw: bytes, info: Any) -> None:
            if not raw:  # its data are lost, as of large pictures in a hurry: a message has its mark at least
                return
            if len(raw) > most:
                complain_of_size(topic, len(raw), most)
            elif versions and (node := versions.other(info)):
                key = "{topic}: {type} has other fields at {node} than here: its messages are not read."
                BOARD.complain(topic, say(key, topic=topic, type=name, node=node))
            else:
                take(raw, info)

        def receive_all(raw: bytes, info: Any) -> None:
            """Take what waits in the queue too: rclpy would take one message for each wait."""
            receive(raw, info)
            with suppress(InvalidHandle), subscription.handle:
                for _ in range(qos.depth - 1):
                    if (taken := subscription.handle.take_message(subscription.msg_type, True)) is None:
                        return
                    receive(*taken)

        found = message_class(kind) if isinstance(kind, str) else kind
        subscription = self.node.create_subscription(
            found, topic, receive_all, qos, event_callbacks=NO_EVENTS, raw=True
        )
        return Subscription(self.node, subscription)

    def ask(
        self,
        kind: Any,
        service: str,
        request: Any,
        patience_s: float,
        before: Callable[[], None] = lambda: None,
    ) -> Any:
        """Call a service and return its answer. Raises `Unreachable`, or `Silent`. Not for the executor's thread.

        `patience_s`: until the service must be found, and again from the request until it must have answered.
        `before` is called just before the request is sent. A service that several nodes serve is not asked: one of
        them may be a stranger.
        """
        client = self.node.create_client(kind, service, qos_profile=ONE_ANSWER)
        answered = threading.Event()
        until_s = time.monotonic() + patience_s
        try:
            while not client.service_is_ready():
                if time.monotonic() >= until_s:
                    raise Unreachable(say("no node of the robot serves {service}", service=service))
                time.sleep(LOOK_S)
            if self.node.count_services(service) > 1:
                raise Unreachable(say("several nodes serve {service}: none is asked", service=service))
            before()
            answer = client.call_async(request)
            answer.add_done_callback(lambda _: answered.set())
            if not answered.wait(patience_s):
                raise Silent(say("{service} does not answer", service=service))
            return answer.result()
        finally:
            self.node.destroy_client(client)

    def close(self, patience_s: float) -> None:
        """Leave the domain. Without the end of the node, others would miss this participant only after 20 s."""
        self._closing = True
        self.read_soon()
        self._executor.shutdown(patience_s)
        if self._thread.is_alive():
            self._thread.join(patience_s)
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        """Call callbacks until the end."""
        failures = 0
        while True:
            began_s = time.monotonic()
            try:
                self._call_back()
                return
            except ExternalShutdownException:
                return
            except InvalidHandle:  # another thread ended a subscription while the executor looked at it
                self._let_all_run()
                continue
            except MemoryError:
                end_without_memory()
            except Exception:
                log.exception("the executor failed")
            failures = failures + 1 if time.monotonic() - began_s < WORKED_S else 1
            if failures > MOST_FAILURES:
                self._on_failed()
                return
            self._let_all_run()

    def _call_back(self) -> None:
        """Call callbacks until the end."""
        patience_s = None if self._rests is None else 0.0
        while not self._closing:
            try:
                call, _, _ = self._executor.wait_for_ready_callbacks(patience_s)
            except TimeoutException:  # after each batch
                self._rest()
                continue
            except ShutdownException:
                return
            call()
            if (error := call.exception()) is not None:
                raise error

    def _rest(self) -> None:
        if self._rests is not None:
            self._reads.wait(self._rests())
            self._reads.clear()

    def _let_all_run(self) -> None:
        """Forget which callback failed: for the executor it still runs, so it would never be called again."""
        node = self.node
        for each in (*node.subscriptions, *node.clients, *node.services, *node.timers, *node.waitables):
            each._executor_event = False


class Subscription:
    """One topic that this process listens to."""

    def __init__(self, node: Node, subscription: Any) -> None:
        self._node, self._subscription = node, subscription

    def unregister(self) -> None:
        """End it."""
        self._node.destroy_subscription(self._subscription)


def complain_of_size(topic: str, size: int, most: int) -> None:
    """Tell the page that a message was too large to be read."""
    key = "{topic}: a node sends messages of {size}, at most {most} is taken."
    BOARD.complain(topic, say(key, topic=topic, size=size_text(size), most=size_text(most)))


def guarded(callback: Callable[..., None]) -> Callable[..., None]:
    """Return a callback that no message can make fail: an exception would end the executor."""

    @wraps(callback)  # rclpy asks for its parameters: with two, it gets what is known about the message too
    def call(*message: Any) -> None:
        try:
            callback(*message)
        except MemoryError:
            end_without_memory()
        except Exception:  # any content of a stranger's message
            log.debug("a message could not be read", exc_info=True)

    return call
