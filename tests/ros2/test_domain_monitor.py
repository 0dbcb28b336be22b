"""The thread that watches a domain, with a node of its own kind."""

import threading

from robots.bridge.robot_reports import RosStatus
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.network import interfaces
from robots.bridge.ros2.network.domain_monitor import DomainMonitor
from robots.bridge.ros2.network.interfaces import Interface, Joined
from robots.shared.configuration.robot_ros import Ros2


class Node:
    holds, cut_off = True, False

    def __init__(self) -> None:
        self.reports: list[RosStatus] = []
        self.holding = 0
        self.ended = threading.Event()

    def join(self) -> None: ...

    def other_bridge(self) -> None: ...

    def survey(self) -> None: ...

    def hold(self) -> None:
        self.holding += 1
        if not self.cut_off:
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


def test_a_bridge_that_is_cut_off_is_given_up_for_a_new_one() -> None:
    node = Node()
    node.cut_off = True
    monitor = DomainMonitor(node)
    monitor.start()
    assert node.ended.wait(5.0)
    (status,) = node.reports
    assert status.text == "This computer has joined another network: the bridge starts again."


def test_a_network_that_comes_after_the_join_is_noticed(monkeypatch) -> None:
    wire, air = (
        Interface(name, 2, address, True) for name, address in (("eth0", "10.0.0.2"), ("wlan0", "10.1.0.2"))
    )
    there = {wire}
    monkeypatch.setattr(interfaces, "interfaces", lambda: frozenset(there))
    joined, here = Joined(Ros2()), Joined(Ros2(discovery="localhost"))
    there.clear()
    assert (joined.new(), joined.moved()) == (False, False)
    there.add(air)
    assert (joined.new(), joined.moved()) == (True, True)
    there.add(wire)
    assert (joined.new(), joined.moved()) == (True, False)
    assert not here.new()
