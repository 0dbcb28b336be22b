"""The thread that watches a domain, with a node of its own kind."""

import threading

from robots.bridge.robot_reports import RosStatus
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.network.domain_monitor import DomainMonitor


class Node:
    holds = True

    def __init__(self) -> None:
        self.reports: list[RosStatus] = []
        self.holding = 0
        self.ended = threading.Event()

    def join(self) -> None: ...

    def other_bridge(self) -> None: ...

    def survey(self) -> None: ...

    def hold(self) -> None:
        self.holding += 1
        message_class("lab_msgs/msg/Lamp")

    def report(self, status: RosStatus) -> None:
        self.reports.append(status)

    def lost(self, name_taken: bool) -> None:
        assert not name_taken
        self.ended.set()


def test_a_robot_with_a_missing_package_is_given_up() -> None:
    node = Node()
    monitor = DomainMonitor(node)
    monitor.start()
    assert node.ended.wait(5.0)
    assert node.holding == 1
    (status,) = node.reports
    assert (status.phase, status.text) == (
        "refused",
        "No installed package has the type lab_msgs/msg/Lamp.",
    )
