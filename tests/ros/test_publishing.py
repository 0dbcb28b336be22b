"""A message waits a moment for its first listeners, and never longer."""

from __future__ import annotations

import itertools

import pytest
from std_msgs.msg import String

from robots.bridge.ros import publishing
from robots.bridge.ros.publishing import Sender
from tests.ros.support import until

_numbers = itertools.count()


@pytest.fixture
def sender(ros):
    sender = Sender(f"/sent_{next(_numbers)}", String)
    yield sender
    sender.close()


def topic(sender):
    return sender.publisher.resolved_name


def test_a_message_reaches_each_who_begins_to_listen_in_time(ros, sender):
    sender.send(String("hello"))
    with ros.listen(topic(sender), String) as first:
        assert first.next().data == "hello"


@pytest.mark.parametrize("lost", ["late", "withdrawn", "heard"])
def test_what_is_late_or_withdrawn_or_heard_by_others_is_not_sent_to_who_comes(
    ros, sender, lost, monkeypatch
):
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
