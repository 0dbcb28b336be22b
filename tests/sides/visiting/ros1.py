"""The visitor of a robot with ROS 1."""

from __future__ import annotations

import itertools
from typing import Any

import genpy
import rosgraph
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus

from robots.bridge.ros.tasks.publishing import immediate_publisher
from robots.shared.ros.message_types.classes import message_class, service_class
from tests.processes import PATIENCE_S, until
from tests.sides.visiting.program import LONG, Visitor, run, waits

ENDS = {
    GoalStatus.PREEMPTED: "canceled",
    GoalStatus.SUCCEEDED: "succeeded",
    GoalStatus.ABORTED: "aborted",
    GoalStatus.REJECTED: "rejected",
    GoalStatus.RECALLED: "canceled",
}


class RospyVisitor(Visitor):
    _goals = itertools.count(1)

    def join(self, name: str) -> None:
        rospy.init_node(name, disable_signals=True, disable_rosout=True)

    def leave(self) -> None:
        rospy.signal_shutdown("the test is over")

    # --- topics -----------------------------------------------------------------------------------

    def listen(self, id: int, topic: str, kind: str, kept: bool, sensor: bool) -> None:
        def take(message: Any) -> None:
            self.tell(id, message=plain(message), by=message._connection_header["callerid"])

        self.listeners[id] = rospy.Subscriber(topic, message_class(kind), take, tcp_nodelay=True)

    def publishers(self, id: int, of: int) -> int:
        return self.listeners[of].get_num_connections()

    def forget(self, id: int, of: int) -> None:
        (self.listeners.pop(of, None) or self.speakers.pop(of)).unregister()

    def speak(self, id: int, topic: str, kind: str, kept: bool) -> None:
        found = message_class(kind)
        if kept:
            self.speakers[id] = rospy.Publisher(topic, found, latch=True, queue_size=10)
        else:
            self.speakers[id] = immediate_publisher(topic, found, PATIENCE_S)

    def heard_by(self, id: int, of: int) -> int:
        return self.speakers[of].get_num_connections()

    def publish(self, id: int, of: int, fields: dict[str, Any]) -> None:
        speaker = self.speakers[of]
        speaker.publish(filled(speaker.data_class(), fields))

    def topic_listeners(self, id: int, topic: str) -> list[str]:
        _, subscribers, _ = rosgraph.Master(rospy.get_name()).getSystemState()
        return [node for name, nodes in subscribers if name == topic for node in nodes]

    # --- services and parameters -------------------------------------------------------------------

    @waits
    def call(self, id: int, service: str, kind: str, fields: dict[str, Any]) -> Any:
        found = service_class(kind)
        rospy.wait_for_service(service, PATIENCE_S)
        return plain(rospy.ServiceProxy(service, found)(filled(found._request_class(), fields)))

    def serve(self, id: int, service: str, kind: str, answer: dict[str, Any]) -> None:
        found = service_class(kind)

        def take(request: Any) -> Any:
            self.tell(id, message=plain(request))
            return filled(found._response_class(), answer)

        served = rospy.Service(service, found, take)
        served.unregister = served.shutdown
        self.speakers[id] = served

    def parameter(self, id: int, node: str, name: str) -> Any:
        return rospy.get_param(_path(node, name))

    def set_parameter(self, id: int, node: str, name: str, value: Any) -> None:
        rospy.set_param(_path(node, name), value)

    # --- actions ----------------------------------------------------------------------------------

    @waits
    def goal(self, id: int, action: str, kind: str, fields: dict[str, Any]) -> None:
        def class_of(part: str) -> Any:
            return message_class(f"{kind}Action{part}")

        goal = class_of("Goal")()
        goal.goal_id.id = own = f"{rospy.get_name()}-{next(self._goals)}"
        filled(goal.goal, fields)
        begun = False

        def status(message: Any) -> None:
            nonlocal begun
            active = any(
                one.goal_id.id == own and one.status == GoalStatus.ACTIVE for one in message.status_list
            )
            if active and not begun:
                begun = True
                self.tell(id, accepted=True)

        def feedback(message: Any) -> None:
            if message.status.goal_id.id == own:
                self.tell(id, feedback=plain(message.feedback))

        def result(message: Any) -> None:
            if message.status.goal_id.id != own:
                return
            end = ENDS[message.status.status]
            if not begun:
                self.tell(id, accepted=end != "rejected")
            self.tell(id, ended=[end, plain(message.result)])

        heard = [
            rospy.Subscriber(f"{action}/{topic}", of, take)
            for topic, of, take in (
                ("status", message_class("actionlib_msgs/GoalStatusArray"), status),
                ("feedback", class_of("Feedback"), feedback),
                ("result", class_of("Result"), result),
            )
        ]
        goals = immediate_publisher(f"{action}/goal", class_of("Goal"), PATIENCE_S)
        until(
            lambda: goals.get_num_connections() and all(one.get_num_connections() for one in heard),
            f"a server of {action}",
        )
        goals.publish(goal)

    @waits
    def cancel(self, id: int, action: str) -> None:
        cancels = immediate_publisher(f"{action}/cancel", GoalID, PATIENCE_S)
        until(cancels.get_num_connections, f"a server of {action}")
        cancels.publish(GoalID())


def _path(node: str, name: str) -> str:
    return f"{node}/{name.replace('.', '/')}"


def plain(value: Any) -> Any:
    """Return a message as JSON knows it."""
    if isinstance(value, genpy.Message):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, genpy.TVal):
        return value.to_sec()
    if isinstance(value, str | bool | int | float):
        return value
    return len(value) if len(value) > LONG else [plain(each) for each in value]


def filled(message: Any, fields: dict[str, Any]) -> Any:
    """Set fields of a message, of messages in it, and of lists of messages."""
    kinds = dict(zip(message.__slots__, message._slot_types, strict=True))
    for name, value in fields.items():
        setattr(message, name, _value(kinds[name], value))
    return message


def _value(kind: str, value: Any) -> Any:
    base, bracket, _ = kind.partition("[")
    if bracket and base in ("uint8", "char") and not isinstance(value, str):
        return bytes(value)
    if bracket:
        return [_value(base, each) for each in value]
    if base == "time":
        return rospy.Time.from_sec(value)
    if base == "duration":
        return rospy.Duration.from_sec(value)
    return filled(message_class(base)(), value) if isinstance(value, dict) else value


if __name__ == "__main__":
    run(RospyVisitor)
