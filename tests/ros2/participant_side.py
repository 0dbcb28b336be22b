"""A participant whose executor cannot take many answers of a service, and what it still hears and is answered then."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import threading
import time
from typing import Any

from rcl_interfaces.srv import ListParameters
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from robots.bridge.ros2.participant import MOST_FAILURES, Participant
from robots.bridge.ros2.qos import EVENTS
from robots.shared.unreachable import Unreachable

NAME, PATIENCE_S = "fleet_try", 10.0


def main() -> None:
    participant = Participant(NAME, int(sys.argv[1]))
    node = participant.node
    failed, heard, answered = threading.Event(), threading.Event(), threading.Event()
    take = SingleThreadedExecutor._take_client

    failures = iter(range(MOST_FAILURES + 1))

    def fail(executor: Any, client: Any) -> Any:
        if next(failures, None) is None:
            failed.set()
            return take(executor, client)
        raise RuntimeError("an unreadable answer")

    SingleThreadedExecutor._take_client = fail
    participant.listen("/words", "std_msgs/msg/String", lambda raw, info: heard.set(), EVENTS)
    node.create_service(ListParameters, "/list", lambda request, answer: answer)
    words, client = (
        node.create_publisher(String, "/words", EVENTS),
        node.create_client(ListParameters, "/list"),
    )
    participant.start()
    assert client.wait_for_service(PATIENCE_S)
    client.call_async(ListParameters.Request())
    assert failed.wait(PATIENCE_S)
    words.publish(String(data="hello"))
    client.call_async(ListParameters.Request()).add_done_callback(lambda _: answered.set())
    print("heard", heard.wait(PATIENCE_S), flush=True)
    print("answered", answered.wait(PATIENCE_S), flush=True)
    print("asked", _is_asked(participant), flush=True)
    node.create_service(ListParameters, "/list", lambda request, answer: answer)
    while node.count_services("/list") < 2:
        time.sleep(0.02)
    print("asked", _is_asked(participant), flush=True)
    services = node.get_service_names_and_types_by_node(NAME, "/")
    print("services", *(name for name, _ in services), flush=True)
    print("parameters", *node._parameters, flush=True)
    print("slow", _waits_from_the_request(participant), flush=True)
    os._exit(0)


def _is_asked(participant: Participant) -> bool:
    try:
        participant.ask(ListParameters, "/list", ListParameters.Request(), PATIENCE_S)
    except Unreachable:
        return False
    return True


def _waits_from_the_request(participant: Participant) -> bool:
    """Ask a service that was found just before patience ended, and takes a moment."""

    def answered(_request: Any, answer: Any) -> Any:
        time.sleep(0.2)
        return answer

    participant.node.create_service(ListParameters, "/slow", answered)
    request, patience_s = ListParameters.Request(), 1.5
    try:
        participant.ask(ListParameters, "/slow", request, patience_s, before=lambda: time.sleep(patience_s))
    except Unreachable:
        return False
    return True


if __name__ == "__main__":
    main()
