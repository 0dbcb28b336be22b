"""Readers of topics in a web process: what each gets, when its client is behind, and the limits."""

import asyncio
import json

import pytest

from robots.bridge.tap.arrivals import Arrival
from robots.link.client import links
from robots.registry.selectors import link_address
from robots.shared import wire
from robots.shared.wire import LinkProcess
from teleop.tap import feed
from teleop.tap.feed import TapReader, feed_of
from tests.teleop.support import eventually
from tests.teleop.tap.support import FakeTap

pytestmark = pytest.mark.django_db(transaction=True)


class Reader:
    """One connection, whose client reads at once unless `behind`."""

    def __init__(self, its_feed, person=None):
        self.behind = False
        self.heard = asyncio.Queue()
        self.states = asyncio.Queue()
        self.tap = TapReader(its_feed, self._deliver, self.states.put_nowait, lambda: self.behind, person)

    async def _deliver(self, topic, form, message):
        self.heard.put_nowait((topic, form, message))

    async def hears(self):
        _, form, message = await asyncio.wait_for(self.heard.get(), 5.0)
        return json.loads(message.body) if form != "cbor" else message.body

    async def learns(self, fits):
        while not fits(state := await asyncio.wait_for(self.states.get(), 5.0)):
            pass
        return state


@pytest.fixture
async def tap(robot, bridge):
    running = FakeTap(robot)
    yield running
    await running.close()


@pytest.fixture
async def open_reader(robot, bridge, tap):
    """`await open_reader(topic, ...)`: a reader whose topic the tap reads."""
    opened = []

    async def open_one(topic="/a", form="json", person=None, **how):
        reader = Reader(feed_of(links.get(robot.id, link_address(robot))), person)
        opened.append(reader)
        assert reader.tap.read(topic, form, **how) is None
        if len(opened) == 1:
            await tap.start(bridge)
        await tap.until(lambda wanted: topic in wanted)
        return reader

    yield open_one
    for reader in opened:
        reader.tap.leave()


async def test_a_message_is_read_once_for_all_readers(open_reader, tap):
    readers = [await open_reader() for _ in range(3)]
    tap.publish("/a", {"data": 1})
    assert [await reader.hears() for reader in readers] == 3 * [{"data": 1}]


async def test_readers_get_messages_again_after_a_fault_of_the_tap(open_reader, tap, monkeypatch, caplog):
    reader = await open_reader()
    with monkeypatch.context() as faulty:
        faulty.setattr(Arrival, "body", lambda *_: 1 // 0)
        tap.publish("/a", {"data": 1})
        await eventually(lambda: "ZeroDivisionError" in caplog.text)
    while reader.heard.empty():
        tap.publish("/a", {"data": 2})
        await asyncio.sleep(0.05)
    assert await reader.hears() == {"data": 2}


async def test_readers_get_messages_again_after_a_fault_of_one_of_them(open_reader, tap, monkeypatch):
    reader, other = await open_reader(), await open_reader()
    with monkeypatch.context() as faulty:
        failed = asyncio.Event()

        def fails(_state):
            failed.set()
            raise ZeroDivisionError

        faulty.setattr(reader.tap, "state", fails)
        tap.describe("/a")
        await asyncio.wait_for(failed.wait(), 5.0)
    while other.heard.empty():
        tap.publish("/a", {"data": 2})
        await asyncio.sleep(0.05)
    assert await other.hears() == {"data": 2}


async def test_a_large_message_that_waits_keeps_back_no_other_topic(open_reader, tap, monkeypatch):
    monkeypatch.setattr(feed, "PERSON_BYTES_PER_S", 1000.0)
    reader = await open_reader("/large")
    reader.tap.read("/small", "json")
    await tap.until(lambda wanted: "/small" in wanted)
    tap.publish("/large", "x" * 10_000)
    tap.publish("/small", {"data": 1})
    assert await reader.hears() == {"data": 1}


async def test_the_largest_message_arrives(open_reader, tap):
    reader = await open_reader()
    large = "x" * (wire.LARGEST_BODY - 2)
    tap.publish("/a", large)
    assert len(await reader.hears()) == len(large)
    tap.publish("/a", large + "x")
    await reader.learns(lambda state: state.refusal and state.refusal.code == "too_large")


async def test_each_message_of_a_burst_arrives(open_reader, tap):
    reader = await open_reader()
    for number in range(30):
        tap.publish("/a", number, publisher=number % 3)
    assert [await reader.hears() for _ in range(30)] == list(range(30))


async def test_a_client_that_is_behind_gets_the_newest_and_harms_nobody(open_reader, tap, monkeypatch):
    monkeypatch.setattr("robots.shared.link.newest_wins.PATIENCE_S", 0.0)
    slow, quick = await open_reader(queue=2), await open_reader()
    slow.behind = True
    for number in range(10):
        tap.publish("/a", number)
        assert await quick.hears() == number
    assert slow.heard.empty()
    slow.behind = False
    assert [await slow.hears(), await slow.hears()] == [8, 9]


async def test_a_slow_reading_gets_the_newest_when_it_is_due(open_reader, tap):
    reader = await open_reader(every_s=0.2)
    for number in range(5):
        tap.publish("/a", number)
    assert await reader.hears() == 4


async def test_who_comes_later_gets_the_latched_message_of_each_publisher(open_reader, tap):
    first = await open_reader()
    tap.publish("/a", "one", latched=True, publisher=1)
    tap.publish("/a", "old", latched=True, publisher=2)
    tap.publish("/a", "two", latched=True, publisher=2)
    tap.publish("/a", "passing", publisher=3)
    assert [await first.hears() for _ in range(4)][-1] == "passing"
    later = await open_reader()
    assert {await later.hears(), await later.hears()} == {"one", "two"}
    other_form = await open_reader(form="raw")
    assert {await other_form.hears(), await other_form.hears()} == {"one", "two"}


async def test_a_topic_is_described_to_each_reader(open_reader, tap):
    first = await open_reader()
    tap.describe("/a")
    assert (await first.learns(lambda state: state.type)).definition == "string data\n"
    later = await open_reader()
    assert (await later.learns(lambda state: state.type)).type == "std_msgs/String"


async def test_the_tap_ends_with_the_last_reader(open_reader, tap, bridge):
    first, second = await open_reader("/a"), await open_reader("/b")
    second.tap.end("/b", "json")
    await tap.until(lambda wanted: set(wanted) == {"/a"})
    second.tap.leave()
    first.tap.leave()
    await bridge.hears(LinkProcess, lambda message: message.process == "tap" and not message.wanted)


async def test_readers_learn_why_the_tap_is_gone(open_reader, bridge, tap):
    reader = await open_reader()
    tap.publish("/a", 1)
    await reader.hears()
    bridge.say(wire.ProcessAt("tap", refusal=wire.Refusal("tap_ended", "It ended.", "robot")))
    await tap.close()
    await reader.learns(lambda state: state.refusal and state.refusal.code == "tap_ended")


@pytest.mark.parametrize("name", ["/a b", "a", "/", "/a//b", "/ä", "/" + "x" * 200, "/a\n", ""])
async def test_a_name_that_no_topic_has_is_refused(name, open_reader, tap):
    reader = await open_reader()
    assert reader.tap.read(name, "json").code == "invalid"
    tap.publish("/a", "goes on")
    assert await reader.hears() == "goes on"


async def test_too_many_topics_are_refused(open_reader, tap):
    reader = await open_reader()
    refusals = [reader.tap.read(f"/many_{number}", "json") for number in range(10_000)]
    assert sum(refusal is None for refusal in refusals) == feed.MOST_READINGS - 1
    assert refusals[-1].code == "too_many_topics" and refusals[-1].figures == {"limit": feed.MOST_READINGS}
    await tap.until(lambda wanted: len(wanted) == feed.MOST_READINGS)


async def test_one_person_alone_does_not_take_all_topics(open_reader, monkeypatch):
    monkeypatch.setattr(feed, "MOST_OF_PERSON", 2)
    await open_reader("/a", person="ana")
    second = await open_reader("/b", person="ana")
    assert second.tap.read("/c", "json").figures == {"limit": 2}
    assert second.tap.read("/a", "json") is None
    await open_reader("/c", person="ben")


async def test_one_persons_messages_have_a_limit(open_reader, tap, monkeypatch):
    monkeypatch.setattr(feed, "PERSON_MESSAGES_PER_S", 2.0)  # so that the burst is four
    monkeypatch.setattr("robots.shared.link.newest_wins.PATIENCE_S", 0.0)
    readers = [await open_reader(person="ana") for _ in range(2)]
    other = await open_reader(person="ben")
    for number in range(20):
        tap.publish("/a", number)
        if number < 4:
            await other.hears()
    assert sum(reader.heard.qsize() for reader in readers) == 4
