"""A flood on a link does not delay ticks, and the stop behind the flood is handled."""

from __future__ import annotations

import asyncio
import time
from itertools import pairwise
from unittest.mock import patch
from uuid import uuid4

import pytest

from robots.bridge.lease.lease_orders import LeaseOrders
from robots.bridge.lease.state_store import StateStore
from robots.bridge.link_handler import DRIVES_BURST, OTHER_ROBOT, REFUSAL_GAP_S, LinkHandler
from robots.bridge.recorder.recorder_client import RecorderClient
from robots.bridge.tasks.speech import SpeechTasks
from robots.bridge.topics.inspector_client import InspectorClient
from robots.shared import wire
from robots.shared.geometry.poses import STILL
from tests.bridge.lease.test_lease_orders import GRANT
from tests.bridge.support import Bench, Wire

FLOOD = 2000


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture
def door(bench, tmp_path):
    orders = LeaseOrders(bench.core, StateStore(tmp_path, "robot"), 0)
    yield LinkHandler(
        bench.core,
        orders,
        InspectorClient(bench.core.config, lambda: None),
        {},
        RecorderClient(bench.core.config, bench.records),
    )
    orders.close()


def drive(seq: int, fence: int = GRANT.fence, x: float = 0.0) -> bytes:
    return wire.encode(
        wire.Drive(fence=fence, seq=seq, sent_ms=time.monotonic() * 1000, x=x, w=0.0, share=1.0)
    )


async def driven(door, bench) -> Wire:
    """Drive the robot by a link, on the clock of the handler; return the link."""
    bench.now_s = time.monotonic()
    bench.online()
    link = Wire(1)
    door.opened(link)
    await door.received(link, wire.encode(GRANT))
    await link.hears(wire.Granted(GRANT.fence))
    await door.received(link, drive(1))
    await door.received(link, drive(2, x=0.5))
    bench.recorded()
    await door.received(link, drive(3, x=0.5))
    assert bench.last.vx > 0
    return link


async def test_between_the_commands_of_a_flood_the_tick_has_its_turn(door, bench):
    link = Wire(1)
    door.opened(link)
    heard = 0
    turns = []

    async def tick() -> None:
        while True:
            turns.append(heard)
            await asyncio.sleep(0)

    ticking = asyncio.create_task(tick())
    begun_s = time.monotonic()
    for heard in range(FLOOD):
        await door.received(link, drive(heard))
    allowed = DRIVES_BURST + 200 * (time.monotonic() - begun_s) + 2
    ticking.cancel()
    assert max(after - before for before, after in pairwise(turns)) <= allowed
    assert bench.core.refused["flood"] >= FLOOD - allowed


async def test_a_stop_in_a_flood_is_carried_out(door, bench):
    link = Wire(1)
    door.opened(link)
    for number in range(FLOOD):
        await door.received(link, drive(number))
    await door.received(link, wire.encode(wire.LinkStop("Ann")))
    assert bench.core.stop_state.by == "Ann"


async def test_flood_on_one_link_does_not_delay_another_holder(door, bench):
    flooder, holder = Wire(1), Wire(2)
    door.opened(flooder)
    door.opened(holder)
    await door.received(holder, wire.encode(GRANT))
    await holder.hears(wire.Granted(GRANT.fence))
    for number in range(FLOOD):
        await door.received(flooder, drive(number))
    await door.received(holder, drive(1))
    assert bench.core.state(time.monotonic(), []).seq == 1


async def test_a_flood_is_answered_a_few_times_a_second(door):
    link = Wire(1)
    door.opened(link)
    begun_s = time.monotonic()
    for number in range(FLOOD):
        await door.received(link, drive(number))
    refused = [report.refusal.code for report in link.reports if isinstance(report, wire.Refused)]
    assert 1 <= refused.count("flood") <= 1 + (time.monotonic() - begun_s) / REFUSAL_GAP_S


async def test_a_refusal_is_not_swallowed_by_one_of_another_link(door):
    links = Wire(1), Wire(2)
    for link in links:
        door.opened(link)
        await door.received(link, drive(1))
        await door.received(link, b"{")
    for link in links:
        refused = [report.refusal.code for report in link.reports if isinstance(report, wire.Refused)]
        assert refused == ["no_lease", "not_json"]


async def test_rubbish_is_answered_and_counted(door, bench):
    link = Wire(1)
    door.opened(link)
    await door.received(link, b"{")
    assert link.reports[-1].refusal.code == "not_json"
    assert bench.core.refused["not_json"] == 1


async def test_another_protocol_is_said_in_words(door):
    link = Wire(1)
    door.opened(link)
    await door.received(link, wire.encode(wire.LinkHello(wire.PROTOCOL + 1, "web 1")))
    assert "restart both" in link.reports[-1].refusal.text
    assert link.ended


async def test_answers_to_stop_and_clear_carry_the_requests_number(door, bench, caplog):
    caplog.set_level("INFO")
    link = Wire(1)
    door.opened(link)
    await door.received(link, wire.encode(wire.LinkStop("Ann", seq=5)))
    assert (link.reports[-1].stop.number, link.reports[-1].seq) == (1, 5)
    await door.received(link, wire.encode(wire.LinkClear("Ann", number=0, seq=6)))
    refused = link.reports[-1]
    assert (refused.of, refused.refusal.code, refused.seq) == ("link_clear", "stopped_again", 6)
    await door.received(link, wire.encode(wire.LinkClear("Ann", number=1, seq=7)))
    assert (link.reports[-1].stop.state, link.reports[-1].seq) == ("clear", 7)
    assert caplog.messages == ["stop 1 was cleared by Ann"]


async def test_closing_link_stops_its_drive_at_once(door, bench):
    door.closed(await driven(door, bench))
    assert bench.last == STILL


async def test_stop_comes_first_when_a_link_closes(door, bench):
    link = await driven(door, bench)
    with patch.object(InspectorClient, "forget", side_effect=BrokenPipeError), pytest.raises(BrokenPipeError):
        door.closed(link)
    assert bench.last == STILL


async def test_every_order_gets_one_answer_with_its_number(door):
    link = Wire(1)
    door.opened(link)
    await door.received(link, wire.encode(GRANT))
    await link.hears(wire.Granted(GRANT.fence))
    for seq in range(3):
        await door.received(link, wire.encode(wire.Play(GRANT.fence, "nod", seq)))
    answers = [report for report in link.reports if isinstance(report, wire.Accepted | wire.Refused)]
    assert [(answer.of, answer.seq) for answer in answers] == [("play", 0), ("play", 1), ("play", 2)]
    assert {answer.refusal.code for answer in answers} == {"robot_offline"}


async def test_a_failing_task_is_refused_and_the_link_stays(door, bench, caplog):
    link = await driven(door, bench)
    with patch.object(
        SpeechTasks, "cancel_request", side_effect=OverflowError("cannot convert float infinity to integer")
    ):
        await door.received(link, wire.encode(wire.SayCancel(GRANT.fence, 7)))
    refused = link.reports[-1]
    assert (refused.of, refused.seq, refused.refusal.code) == ("say_cancel", 7, "bridge_fault")
    assert "float infinity" in caplog.text
    assert bench.core.refused["bridge_fault"] == 1
    await door.received(link, wire.encode(wire.SayCancel(GRANT.fence, 8)))
    assert link.reports[-1].refusal.code == "no_speech"


async def test_an_order_that_breaks_after_its_answer_gets_no_other_one(door, bench):
    link = await driven(door, bench)

    def breaks(order, by, now_s, answer):
        answer(None)
        raise OverflowError

    with patch.object(bench.core.tasks, "take", breaks):
        await door.received(link, wire.encode(wire.SayCancel(GRANT.fence, 7)))
    assert link.reports[-1] == wire.Accepted("say_cancel", 7, GRANT.fence)


async def test_an_order_that_broke_is_not_answered_later(door, bench):
    link = await driven(door, bench)
    later = []

    def breaks(order, by, now_s, answer):
        later.append(answer)
        raise OverflowError

    with patch.object(bench.core.tasks, "take", breaks):
        await door.received(link, wire.encode(wire.SayCancel(GRANT.fence, 7)))
    refused = link.reports[-1]
    later[0](None)
    assert link.reports[-1] is refused


async def test_web_process_gets_capabilities_at_once_and_on_request(door, bench):
    link = Wire(1)
    door.opened(link)
    assert [type(report) for report in link.reports] == [wire.BridgeHello]
    await door.received(link, wire.encode(wire.LinkHello(wire.PROTOCOL, "web 1")))
    assert [type(report) for report in link.reports[1:]] == [wire.Status, wire.Offers, wire.GoPath]
    await door.received(link, wire.encode(wire.Refresh(seq=4)))
    assert link.reports[-1] == wire.Accepted("refresh", 4)
    assert bench.base.readings == 1


async def test_stop_works_before_the_hello_and_needs_no_state(door, bench):
    link = Wire(1)
    with patch.object(bench.core, "state", side_effect=OverflowError("nothing encodes this")):
        door.opened(link)
        await door.received(link, wire.encode(wire.LinkStop("Ann", seq=3)))
    assert bench.core.stop_state.state == "stopping"
    assert link.reports[-1] == wire.Stopped(bench.core.stop_state, 3)


async def test_a_stop_that_means_another_robot_is_refused(door, bench):
    link = Wire(1)
    door.opened(link)
    await door.received(link, wire.encode(wire.LinkStop("Ann", seq=3, robot=uuid4())))
    assert bench.core.stop_state.state == "clear"
    assert link.reports[-1] == wire.Refused("link_stop", OTHER_ROBOT, 3)


@pytest.mark.parametrize(
    "raw",
    [b'{"t":"link_stop"}', b'{"t":"link_stop","by":5}', b'{"t":"link_stop","by":"' + b"x" * 300 + b'"}'],
)
async def test_a_stop_that_does_not_fit_stops(door, bench, raw):
    link = Wire(1)
    door.opened(link)
    await door.received(link, raw)
    assert bench.core.stop_state.state == "stopping"
    assert isinstance(link.reports[-1], wire.Stopped)


async def test_one_press_that_arrives_twice_stops_once(door, bench):
    link, press = Wire(1), uuid4()
    door.opened(link)
    stop = wire.encode(wire.LinkStop("Ann", press=press))
    await door.received(link, stop)
    number = bench.core.stop_state.number
    await door.received(link, wire.encode(wire.LinkClear("Ann", number)))
    await door.received(link, stop)
    assert link.reports[-1] == wire.Stopped(wire.StopState("clear", number=number), press=press)
    assert bench.core.stop_state.state == "clear"


async def test_a_clear_outlives_the_older_presses_that_it_names(door, bench):
    link, pending = Wire(1), uuid4()
    door.opened(link)
    await door.received(link, wire.encode(wire.LinkStop("Ann")))
    number = bench.core.stop_state.number
    await door.received(link, wire.encode(wire.LinkClear("Ann", number, presses=[pending])))
    await door.received(link, wire.encode(wire.LinkStop("Ann", press=pending)))
    assert bench.core.stop_state.state == "clear"
    await door.received(link, wire.encode(wire.LinkStop("Ann", press=uuid4())))
    assert bench.core.stop_state.state == "stopping"


def velocity(seq: int, vx: float, fence: int = GRANT.fence) -> bytes:
    sent_ms = time.monotonic() * 1000
    fields = {"linear": {"x": vx}}
    return wire.encode(
        wire.LinkVelocity(
            wire.Publish(fence, "/key_vel", "geometry_msgs/Twist", fields, sent_ms=sent_ms, seq=seq)
        )
    )


async def test_a_stream_of_velocities_is_answered_only_when_it_is_refused(door, bench):
    link = await driven(door, bench)
    await door.received(link, drive(4))
    for number in range(1, 4):
        await door.received(link, velocity(number, 0.3))
    assert bench.last.vx > 0
    await door.received(link, velocity(1, 0.3))
    [refused] = [report for report in link.reports if isinstance(report, wire.Refused)]
    assert (refused.of, refused.refusal.code, refused.seq) == ("velocity", "out_of_order", 1)
    assert not [report for report in link.reports if isinstance(report, wire.Accepted)]
    for number in range(5, 5 + FLOOD):
        await door.received(link, velocity(number, 0.3))
    assert bench.core.refused["flood"] > 0
