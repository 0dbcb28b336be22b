"""The visitor of a robot with ROS 2."""

from __future__ import annotations

import re
import threading
from contextlib import suppress
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rcl_interfaces.msg import Parameter as SetParameter
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

import robots.bridge.ros2  # noqa: F401  (first: makes rclpy importable)
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.network.graph import UNNAMED
from robots.bridge.ros2.participant import TypeInUse
from tests.processes import PATIENCE_S, until
from tests.sides.visiting.program import LONG, Visitor, run, waits

DEPTH = 100
ENDS = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
}


def kind_of(plain_name: str, group: str = "msg") -> Any:
    package, _, short = plain_name.partition("/")
    return message_class(f"{package}/{group}/{short}")


def node_of(endpoint: Any) -> str:
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"


def profile(*, kept: bool, sensor: bool = False) -> QoSProfile:
    return QoSProfile(
        depth=DEPTH,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        reliability=ReliabilityPolicy.BEST_EFFORT if sensor else ReliabilityPolicy.RELIABLE,
    )


class RclpyVisitor(Visitor):
    def join(self, name: str) -> None:
        rclpy.init()
        self.node = rclpy.create_node(name, allow_undeclared_parameters=True)
        self._actions: dict[str, ActionClient] = {}
        self._names: dict[bytes, str] = {}
        threading.Thread(target=self._spin, daemon=True).start()

    def leave(self) -> None:
        self.node.destroy_node()  # else others miss it only after 20 s
        rclpy.shutdown()

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            rclpy.spin(self.node)

    # --- topics -----------------------------------------------------------------------------------

    def listen(self, id: int, topic: str, kind: str, kept: bool, sensor: bool) -> None:
        def take(message: Any, info: Any) -> None:
            self.tell(id, message=plain(message), by=self._publisher(topic, info))

        self.listeners[id] = self.node.create_subscription(
            kind_of(kind), topic, take, profile(kept=kept, sensor=sensor)
        )

    def _publisher(self, topic: str, info: Any) -> str:
        """Return the name of the node that sent a message."""
        gid = bytes(info["publisher_gid"]["data"])
        if gid not in self._names:
            for one in self.node.get_publishers_info_by_topic(topic):
                if one.node_name != UNNAMED:  # the name of a new node comes a little later
                    self._names[bytes(one.endpoint_gid)] = node_of(one)
        return self._names.get(gid, "")

    def publishers(self, id: int, of: int) -> int:
        return self.listeners[of].get_publisher_count()

    def forget(self, id: int, of: int) -> None:
        if listener := self.listeners.pop(of, None):
            self.node.destroy_subscription(listener)
            return
        speaker = self.speakers.pop(of)
        if not (self.node.destroy_publisher(speaker) or self.node.destroy_service(speaker)):
            raise LookupError(of)

    def speak(self, id: int, topic: str, kind: str, kept: bool) -> None:
        found, wanted = kind_of(kind), profile(kept=kept)

        def made() -> Any:
            with suppress(TypeInUse):
                return self.node.create_publisher(found, topic, wanted)

        self.speakers[id] = until(made, f"the end of another type on {topic}")

    def heard_by(self, id: int, of: int) -> int:
        return self.speakers[of].get_subscription_count()

    def publish(self, id: int, of: int, fields: dict[str, Any]) -> None:
        speaker = self.speakers[of]
        speaker.publish(filled(speaker.msg_type(), fields))

    def topic_listeners(self, id: int, topic: str) -> list[str]:
        return [node_of(one) for one in self.node.get_subscriptions_info_by_topic(topic)]

    # --- services and parameters -------------------------------------------------------------------

    @waits
    def call(self, id: int, service: str, kind: str, fields: dict[str, Any]) -> Any:
        found = kind_of(kind, "srv")
        return plain(self._ask(found, service, filled(found.Request(), fields)))

    def serve(self, id: int, service: str, kind: str, answer: dict[str, Any]) -> None:
        def take(request: Any, response: Any) -> Any:
            self.tell(id, message=plain(request))
            return filled(response, answer)

        self.speakers[id] = self.node.create_service(kind_of(kind, "srv"), service, take)

    @waits
    def parameter(self, id: int, node: str, name: str) -> Any:
        answer = self._ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=[name]))
        found = parameter_value_to_python(answer.values[0])
        return found if found is None or isinstance(found, str | bool | int | float) else list(found)

    @waits
    def set_parameter(self, id: int, node: str, name: str, value: Any) -> None:
        asked = [SetParameter(name=name, value=Parameter(name, value=value).get_parameter_value())]
        answer = self._ask(SetParameters, f"{node}/set_parameters", SetParameters.Request(parameters=asked))
        assert answer.results[0].successful, answer.results[0].reason

    def _ask(self, kind: Any, service: str, request: Any) -> Any:
        client, answered = self.node.create_client(kind, service), threading.Event()
        assert client.wait_for_service(PATIENCE_S), f"nobody serves {service}"
        answer = client.call_async(request)
        answer.add_done_callback(lambda _: answered.set())
        assert answered.wait(PATIENCE_S), f"{service} does not answer"
        return answer.result()

    # --- actions ----------------------------------------------------------------------------------

    @waits
    def goal(self, id: int, action: str, kind: str, fields: dict[str, Any]) -> None:
        found = kind_of(kind, "action")
        if action not in self._actions:
            self._actions[action] = ActionClient(self.node, found, action)
        client = self._actions[action]
        assert client.wait_for_server(PATIENCE_S), f"nobody serves {action}"

        def ended(answer: Any) -> None:
            self.tell(id, ended=[ENDS[answer.result().status], plain(answer.result().result)])

        def begun(sent: Any) -> None:
            self.tell(id, accepted=sent.result().accepted)
            if sent.result().accepted:
                sent.result().get_result_async().add_done_callback(ended)
            else:
                self.tell(id, ended=["rejected", None])

        sent = client.send_goal_async(
            filled(found.Goal(), fields), lambda message: self.tell(id, feedback=plain(message.feedback))
        )
        sent.add_done_callback(begun)

    @waits
    def cancel(self, id: int, action: str) -> None:
        self._ask(CancelGoal, f"{action}/_action/cancel_goal", CancelGoal.Request())


def plain(value: Any) -> Any:
    """Return a message as JSON knows it."""
    if hasattr(value, "get_fields_and_field_types"):
        names = list(value.get_fields_and_field_types())
        if names == ["sec", "nanosec"]:
            return value.sec + value.nanosec / 1e9
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, str | bool | int | float):
        return value
    if hasattr(value, "tolist"):  # an array
        value = value.tolist()
    if isinstance(value, bytes):  # an octet
        return value[0]
    return len(value) if len(value) > LONG else [plain(each) for each in value]


def filled(message: Any, fields: dict[str, Any]) -> Any:
    """Set fields of a message, of messages in it, and of lists of messages."""
    kinds = message.get_fields_and_field_types()
    for name, value in fields.items():
        setattr(message, name, _value(kinds[name], value))
    return message


def _value(kind: str, value: Any) -> Any:
    if listed := re.fullmatch(r"sequence<([^,>]+)(?:, \d+)?>|(.+)\[\d+\]", kind):
        return [_value(listed[1] or listed[2], each) for each in value]
    if kind in ("builtin_interfaces/Time", "builtin_interfaces/Duration"):
        seconds = int(value // 1)
        return kind_of(kind)(sec=seconds, nanosec=round((value - seconds) * 1e9))
    if kind in ("float", "double"):
        return float(value)
    if kind == "octet":
        return bytes([value])
    return filled(kind_of(kind)(), value) if isinstance(value, dict) else value


if __name__ == "__main__":
    run(RclpyVisitor)
