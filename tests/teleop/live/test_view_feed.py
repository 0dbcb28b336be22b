"""Views: each ready viewer gets the newest one; nothing is queued."""

import asyncio
from collections import Counter

import pytest

from robots.shared import wire
from teleop.live.view_feed import FULL_RATE_VIEWERS, Viewer, ViewFeed

pytestmark = pytest.mark.django_db(transaction=True)


async def test_page_gets_the_newest_picture_after_drawing_the_last(open_page, bridge):
    page = await open_page("observer")
    await bridge.hears(wire.Viewers, lambda watch: watch.watchers == ["Obi Observer"])
    bridge.show(1)
    assert (await page.hears("view"))["state"]["seq"] == 1

    for number in (2, 3):
        bridge.show(number)
        await page.hears_nothing("view")
    await page.say("ack")
    assert (await page.hears("view"))["state"]["seq"] == 3


async def test_ready_page_waits_for_the_next_picture(open_page, bridge):
    page = await open_page("observer")
    await bridge.hears(wire.Viewers, lambda watch: watch.watchers == ["Obi Observer"])
    bridge.show(1)
    await page.hears("view")
    await page.say("ack")
    await page.hears_nothing("view")
    bridge.show(2)
    assert (await page.hears("view"))["state"]["seq"] == 2


async def test_bridge_knows_the_names_of_the_viewers(open_page, bridge):
    first, second = await open_page("observer"), await open_page("operator")
    await bridge.hears(wire.Viewers, lambda watch: watch.watchers == ["Obi Observer", "Olga Operator"])
    await first.close()
    await bridge.hears(wire.Viewers, lambda watch: watch.watchers == ["Olga Operator"])
    await second.close()
    await bridge.hears(wire.Viewers, lambda watch: watch.watchers == [])


async def test_picture_is_passed_on_as_the_bridge_encoded_it(open_page, bridge):
    page = await open_page("observer")
    await bridge.hears(wire.Viewers, lambda watch: watch.watchers == ["Obi Observer"])
    sent = bridge.show(1)
    await page.hears("view")
    assert page.last_raw == sent


async def test_stalled_viewer_delays_no_other_and_stores_no_picture():
    views = ViewFeed()
    sent = {"stalled": [], "lively": []}

    def viewer(name):
        async def send(event):
            sent[name].append(event["text"])

        return Viewer(views, send)

    stalled, lively = viewer("stalled"), viewer("lively")
    for number in range(1000):
        views.publish(str(number))
        await asyncio.sleep(0)
        await lively.acknowledge()
    await asyncio.sleep(0)
    await views.close()
    assert sent["stalled"] == ["0"]
    assert len(sent["lively"]) > 900
    assert stalled not in views.ready


async def test_many_viewers_take_turns_but_the_driver_gets_all():
    views = ViewFeed()
    sent = {}

    def viewer(name):
        sent[name] = []

        async def send(event):
            sent[name].append(int(event["text"]))

        return Viewer(views, send)

    crowd = [viewer(name) for name in range(3 * FULL_RATE_VIEWERS)]
    crowd[0].is_driver = True
    for number in range(1, 101):
        views.publish(str(number))
        await asyncio.sleep(0)
        for reader in crowd:
            if reader.shown == number:
                await reader.acknowledge()
    await views.close()
    assert len(sent[0]) == 100
    assert all(33 <= len(sent[name]) <= 35 for name in range(1, len(crowd)))
    newest = Counter(sent[name][-1] for name in range(1, len(crowd)))
    assert max(newest.values()) <= FULL_RATE_VIEWERS + 1  # not all get the same views


async def test_viewer_that_fails_to_send_affects_no_other():
    views, sent, arrived = ViewFeed(), [], asyncio.Event()

    async def fails(_event):
        raise RuntimeError("a fault of ours")

    async def send(event):
        sent.append(event["text"])
        arrived.set()

    Viewer(views, fails)
    lively = Viewer(views, send)
    for number in range(2):
        arrived.clear()
        views.publish(str(number))
        await asyncio.wait_for(arrived.wait(), 5)
        await lively.acknowledge()
    assert sent == ["0", "1"]
    await views.close()
