"""Samples of topics: each ready viewer gets the newest one at its own rate; nothing is queued."""

import asyncio

import pytest

from teleop.live.topic_feed import MAX_SUBSCRIPTIONS, TopicFeed, TopicViewer


@pytest.fixture
async def feed():
    """The feed of one robot; `requested` holds the subscriptions that its bridge got last."""
    feed = TopicFeed(lambda wanted: setattr(feed, "requested", dict(wanted)))
    yield feed
    for viewer in list(feed.viewers):
        viewer.leave()


@pytest.fixture
def viewer(feed):
    """`viewer()` makes a connection; `sent` lists the samples sent to it."""

    def one():
        async def send(event):
            new.sent.append(event["text"])
            new.was_sent.set()

        new = TopicViewer(feed, send)
        new.sent = []
        new.was_sent = asyncio.Event()
        return new

    return one


async def turns(count=5):
    for _ in range(count):
        await asyncio.sleep(0)


async def test_stalled_connection_delays_no_other_and_stores_nothing(feed, viewer):
    stalled, lively = viewer(), viewer()
    stalled.subscribe("/a", 10.0)
    lively.subscribe("/a", 1e9)
    for number in range(1000):
        feed.publish("/a", str(number))
        await turns()
        lively.acknowledge()
    assert stalled.sent == ["0"]
    assert lively.sent[-1] == "999"
    assert len(lively.sent) > 900
    assert len(feed.newest) == 1


async def test_last_sample_is_shown_though_none_follows(feed, viewer):
    one = viewer()
    one.subscribe("/a", 4.0)
    feed.publish("/a", "first")
    await turns()
    one.acknowledge()
    feed.publish("/a", "second")
    feed.publish("/a", "last")
    await turns()
    assert one.sent == ["first"]  # the next is due in 0.25 s
    one.was_sent.clear()
    await asyncio.wait_for(one.was_sent.wait(), 10)
    assert one.sent == ["first", "last"]


async def test_each_viewer_gets_its_own_rate(feed, viewer):
    seldom, often = viewer(), viewer()
    seldom.subscribe("/a", 0.001)
    often.subscribe("/a", 1e9)
    assert feed.requested == {"/a": 1e9}
    for number in range(20):
        feed.publish("/a", str(number))
        await turns()
        seldom.acknowledge()
        often.acknowledge()
    assert (len(seldom.sent), len(often.sent)) == (1, 20)


async def test_samples_are_acknowledged_in_order(feed, viewer):
    one = viewer()
    for topic in ("/a", "/b"):
        one.subscribe(topic, 1e9)
        feed.publish(topic, f"{topic} 1")
        await turns()
        feed.publish(topic, f"{topic} 2")
    await turns()
    assert one.sent == ["/a 1", "/b 1"]
    one.acknowledge()
    await turns()
    assert one.sent[2:] == ["/a 2"]


async def test_changing_topics_does_not_bypass_acknowledgement(feed, viewer):
    one = viewer()
    for number in range(100):
        topic = f"/topic{number}"
        one.subscribe(topic, 1e9)
        feed.publish(topic, topic)
        await turns()
        one.unsubscribe(topic)
    assert len(one.sent) == MAX_SUBSCRIPTIONS
    assert feed.newest == {}
    one.subscribe("/topic0", 1e9)  # its first sample is not acknowledged yet
    feed.publish("/topic0", "again")
    await turns()
    assert len(one.sent) == MAX_SUBSCRIPTIONS
    one.acknowledge()
    await turns()
    assert one.sent[MAX_SUBSCRIPTIONS:] == ["again"]


async def test_unacknowledged_samples_are_limited(feed, viewer):
    one = viewer()
    for number in range(MAX_SUBSCRIPTIONS - 1):
        one.subscribe(f"/old{number}", 1e9)
        feed.publish(f"/old{number}", "old")
    await turns()
    for number in range(MAX_SUBSCRIPTIONS - 1):
        one.unsubscribe(f"/old{number}")
    for topic in ("/a", "/b"):
        one.subscribe(topic, 1e9)
        feed.publish(topic, topic)
    await turns()
    assert len(one.sent) == MAX_SUBSCRIPTIONS


async def test_acknowledging_nothing_does_nothing(feed, viewer):
    one = viewer()
    one.acknowledge()
    one.subscribe("/a", 1e9)
    feed.publish("/a", "first")
    feed.publish("/b", "nobody feed")
    await turns()
    assert one.sent == ["first"]


async def test_connection_that_fails_to_send_affects_no_other(feed, viewer):
    async def fails(_event):
        raise RuntimeError("a fault of ours")

    broken, lively = TopicViewer(feed, fails), viewer()
    broken.subscribe("/a", 10.0)
    lively.subscribe("/a", 10.0)
    feed.publish("/a", "first")
    await turns()
    assert lively.sent == ["first"]


async def test_samples_are_forgotten_when_the_bridge_goes(feed, viewer):
    viewer().subscribe("/a", 10.0)
    feed.publish("/a", "old")
    feed.clear()
    late = viewer()
    late.subscribe("/a", 10.0)
    await turns()
    assert late.sent == []
