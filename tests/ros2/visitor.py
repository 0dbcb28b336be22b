"""A plain rclpy client of a robot. Each line of stdin is a command in JSON; each answer is a word and JSON in a line.

{"listen": TOPIC, "kind": KIND, "kept": BOOL, "sensor": BOOL}   -> TOPIC MESSAGE, for each message
{"publishers": TOPIC, "count": COUNT}                           -> publishers COUNT, when so many have found it
{"publish": TOPIC, "kind": KIND, "fields": …}                   -> nothing; sent when somebody listens
{"goal": ACTION, "kind": KIND, "fields": …}                     -> accepted BOOL, feedback MESSAGE, ended […]
{"cancel": ACTION}                                              -> cancelled COUNT, of all goals of all clients
{"call": SERVICE, "kind": KIND, "fields": …}                    -> answer MESSAGE
{"parameters": NODE, "names": […]}                              -> parameters […]
"""

import robots.simulator.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import json
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from numbers import Integral
from typing import Any

import rclpy
from action_msgs.srv import CancelGoal
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from robots.simulator.ros2.side import interface

PATIENCE_S = 15.0


def tell(word: str, value: Any) -> None:
    print(word, json.dumps(value, separators=(",", ":")), flush=True)


def plain(value: Any) -> Any:
    """Return a message as JSON knows it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bool, int, float)):
        return value
    if isinstance(value, Integral):  # numpy's
        return int(value)
    return len(value) if len(value) > 100 else [plain(each) for each in value]


def filled(message: Any, fields: dict[str, Any]) -> Any:
    """Set fields of a message, of messages in it, and of lists of messages."""
    for name, value in fields.items():
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        elif value and isinstance(value, list) and isinstance(value[0], dict):
            kind = message.get_fields_and_field_types()[name].removeprefix("sequence<").removesuffix(">")
            setattr(message, name, [filled(interface(kind)(), each) for each in value])
        else:
            setattr(message, name, value)
    return message


class Visitor:
    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node(sys.argv[2] if len(sys.argv) > 2 else "visitor")
        self._listeners: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._actions: dict[str, ActionClient] = {}

    def listen(self, topic: str, kind: str, kept: bool = False, sensor: bool = False) -> None:
        profile = QoSProfile(
            depth=100,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
            reliability=ReliabilityPolicy.BEST_EFFORT if sensor else ReliabilityPolicy.RELIABLE,
        )
        self._listeners[topic] = self.node.create_subscription(
            interface(kind), topic, lambda message: tell(topic, plain(message)), profile
        )

    def publishers(self, topic: str, count: int) -> None:
        listener = self._listeners[topic]
        self._await(lambda: listener.get_publisher_count() >= count, f"{count} publishers on {topic}")
        tell("publishers", listener.get_publisher_count())

    def publish(self, topic: str, kind: str, fields: dict[str, Any]) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(interface(kind), topic, 1)
        publisher = self._publishers[topic]
        self._await(lambda: publisher.get_subscription_count() > 0, f"a listener to {topic}")
        publisher.publish(filled(interface(kind)(), fields))

    def goal(self, action: str, kind: str, fields: dict[str, Any]) -> None:
        if action not in self._actions:
            self._actions[action] = ActionClient(self.node, interface(kind, "action"), action)
        client = self._actions[action]
        assert client.wait_for_server(PATIENCE_S), action
        goal = filled(interface(kind, "action").Goal(), fields)
        sent = client.send_goal_async(goal, lambda message: tell("feedback", plain(message.feedback)))
        sent.add_done_callback(self._begun)

    def _begun(self, sent: Any) -> None:
        tell("accepted", sent.result().accepted)
        if sent.result().accepted:
            ended = sent.result().get_result_async()
            ended.add_done_callback(
                lambda answer: tell("ended", [answer.result().status, plain(answer.result().result)])
            )

    def cancel(self, action: str) -> None:
        self._call(
            CancelGoal,
            f"{action}/_action/cancel_goal",
            CancelGoal.Request(),
            lambda answer: tell("cancelled", len(answer.goals_canceling)),
        )

    def call(self, service: str, kind: str, fields: dict[str, Any]) -> None:
        found = interface(kind, "srv")
        asked = filled(found.Request(), fields)
        self._call(found, service, asked, lambda answer: tell("answer", plain(answer)))

    def parameters(self, node: str, names: list[str]) -> None:
        self._call(
            GetParameters,
            f"{node}/get_parameters",
            GetParameters.Request(names=names),
            lambda answer: tell(
                "parameters",
                [
                    list(value) if hasattr(value := parameter_value_to_python(each), "typecode") else value
                    for each in answer.values
                ],
            ),
        )

    def _call(self, kind: Any, service: str, asked: Any, take: Callable[[Any], None]) -> None:
        client = self.node.create_client(kind, service)
        assert client.wait_for_service(PATIENCE_S), service
        client.call_async(asked).add_done_callback(lambda answer: take(answer.result()))

    def _await(self, condition: Callable[[], bool], what: str) -> None:
        waiting = threading.Event()
        for _ in range(int(PATIENCE_S / 0.02)):
            if condition():
                return
            waiting.wait(0.02)  # DDS tells nobody
        raise AssertionError(f"not found: {what}")


def main() -> None:
    visitor = Visitor()

    def spin() -> None:
        with suppress(ExternalShutdownException):
            rclpy.spin(visitor.node)

    threading.Thread(target=spin, daemon=True).start()
    for line in sys.stdin:
        asked = json.loads(line)
        what = next(iter(asked))
        getattr(visitor, what)(asked.pop(what), **asked)
    os._exit(0)  # its threads never end


if __name__ == "__main__":
    main()
