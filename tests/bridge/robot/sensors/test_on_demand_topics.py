"""Topics that are subscribed only while a person has control."""

from __future__ import annotations

import contextlib

from robots.bridge.robot.sensors.on_demand_topics import OnDemandTopics


class AtOnce:
    """A worker without a thread."""

    def do(self, call):
        with contextlib.suppress(OSError):
            call()


class Part:
    """One topic. Subscribing fails if it is broken."""

    def __init__(self, broken=False):
        self.broken = broken
        self.subscribed = 0
        self.forgot = 0

    def listen(self):
        if self.broken:
            raise OSError("the master hung up")
        self.subscribed += 1
        return [self]

    def unregister(self):
        self.subscribed -= 1

    def forget(self):
        self.forgot += 1


def test_old_subscriptions_end_with_control_and_are_retried():
    first, second = Part(), Part(broken=True)
    on_demand = OnDemandTopics(AtOnce(), first, second)
    on_demand.set_wanted(True)
    assert (first.subscribed, second.subscribed) == (1, 0)
    on_demand.set_wanted(False)
    assert (first.subscribed, first.forgot, second.forgot) == (0, 1, 1)
    second.broken = False
    on_demand.set_wanted(True)
    assert (first.subscribed, second.subscribed) == (1, 1)
