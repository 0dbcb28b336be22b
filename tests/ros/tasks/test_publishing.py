"""A message waits a short limited time for its first subscribers."""

from __future__ import annotations

import itertools
import queue

import pytest
import rospy
from std_msgs.msg import String

from robots.bridge.ros.network.tcpros import connect_to_publisher
from robots.bridge.ros.tasks import publishing
from robots.bridge.ros.tasks.publishing import Sender
from tests.processes import PATIENCE_S, until

_numbers = itertools.count()


@pytest.fixture
def sender(ros):
    sender = Sender(f"/sent_{next(_numbers)}", String)
    yield sender
    sender.close()


def topic(sender):
    return sender.publisher.resolved_name


class Connected(rospy.SubscribeListener):
    """Stores each new connection. rospy calls it after the listener that was added before."""

    def __init__(self) -> None:
        self.news: queue.SimpleQueue[str] = queue.SimpleQueue()

    def peer_subscribe(self, topic_name, _all, _peer) -> None:
        self.news.put(topic_name)


@pytest.mark.parametrize(
    ("node", "reported"), [("/lab", 1), ("/first", 1), ("/fleet_bridge", 0), ("/fleet_inspector_lab_1", 0)]
)
def test_new_listeners_are_reported_except_own_nodes(ros, node, reported):
    joined, connected = [], Connected()
    sender = Sender(f"/sent_{next(_numbers)}", String, lambda: joined.append(True))
    sender.publisher.impl.add_subscriber_listener(connected)

    def listening(node):
        return connect_to_publisher(topic(sender), rospy.get_node_uri(), node)

    try:
        with listening("/first"):
            connected.news.get(timeout=PATIENCE_S)
            with listening(node):  # may be the first listener, started again
                connected.news.get(timeout=PATIENCE_S)
                assert len(joined) == 1 + reported
    finally:
        sender.close()


def test_a_message_reaches_each_subscriber_that_joins_in_time(ros, sender):
    sender.send(String("hello"))
    with ros.listen(topic(sender), String) as first:
        assert first.next().data == "hello"


@pytest.mark.parametrize("lost", ["late", "withdrawn", "heard"])
def test_late_withdrawn_or_foreign_messages_are_not_sent(ros, sender, lost, monkeypatch):
    if lost == "late":
        monkeypatch.setattr(publishing, "PATIENCE_S", 0.0)
    if lost == "heard":
        with ros.listen(topic(sender), String) as first:
            until(lambda: sender.publisher.get_num_connections(), "somebody listens")
            sender.send(String("old"))
            assert first.next().data == "old"
        until(lambda: not sender.publisher.get_num_connections(), "nobody listens any more")
    else:
        sender.send(String("old"))
    if lost == "withdrawn":
        sender.withdraw()
    with ros.listen(topic(sender), String) as second:
        until(lambda: sender.publisher.get_num_connections(), "somebody listens")
        sender.send(String("new"))
        assert second.next().data == "new"
