"""A participant whose executor cannot take one answer of a service, and what it still hears and is answered then."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import threading
from typing import Any

from rcl_interfaces.srv import ListParameters
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import EVENTS

NAME, PATIENCE_S = "fleet_try", 10.0


def main() -> None:
    participant = Participant(NAME, int(sys.argv[1]))
    node = participant.node
    failed, heard, answered = threading.Event(), threading.Event(), threading.Event()
    take = SingleThreadedExecutor._take_client

    def fail_once(executor: Any, client: Any) -> Any:
        SingleThreadedExecutor._take_client = take
        failed.set()
        raise RuntimeError("an unreadable answer")

    SingleThreadedExecutor._take_client = fail_once
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
    services = node.get_service_names_and_types_by_node(NAME, "/")
    print("services", *(name for name, _ in services), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
