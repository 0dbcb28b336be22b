"""A new fence is on disk before it is valid, and a hanging disk delays nothing else."""

from __future__ import annotations

import asyncio
import threading
from uuid import UUID

import pytest

from robots.bridge.lease.lease_orders import LeaseOrders
from robots.bridge.lease.state_store import SavedState
from robots.bridge.link_handler import LinkHandler
from robots.bridge.recorder.recorder_client import RecorderClient
from robots.bridge.server.link_server import LinkServer
from robots.bridge.topics.inspector_client import InspectorClient
from robots.link.client import BridgeLink
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from tests.bridge.server.test_link import Follower
from tests.bridge.support import Bench, Wire

GRANT = wire.Grant(5, 60.0, "session-5", "Ann", "ann-id", 1.0)


class Disk:
    """A state file on a disk that hangs until `free` is set, or fails."""

    def __init__(self) -> None:
        self.saved: list[SavedState] = []
        self.reached = threading.Event()
        self.free = threading.Event()
        self.fails = False

    def save(self, state: SavedState) -> None:
        self.reached.set()
        assert self.free.wait(10)
        if self.fails:
            raise OSError(28, "No space left on device")
        self.saved.append(state)


@pytest.fixture
def disk():
    disk = Disk()
    yield disk
    disk.free.set()


@pytest.fixture
def core():
    return Bench().online().core


@pytest.fixture
def orders(core, disk):
    orders = LeaseOrders(core, disk, 0)
    yield orders
    disk.free.set()
    orders.close()


def asks_to_move(core, fence: int) -> wire.Refusal | None:
    drive = wire.Drive(fence=fence, seq=1, sent_ms=0.0, x=0.0, w=0.0)
    return core.drive(drive, 1, 100.0)


async def test_a_fence_counts_only_when_it_is_on_disk(orders, core, disk):
    link = Wire(1)
    orders.handle(link, GRANT)
    assert asks_to_move(core, 5).code == "no_lease"
    assert not link.reports
    disk.free.set()
    await link.hears(wire.Granted(5))
    assert disk.saved[0].fence == 5
    assert asks_to_move(core, 5) is None


async def test_a_number_on_disk_is_renewed_without_the_disk(orders, core, disk):
    link = Wire(1)
    disk.free.set()
    orders.handle(link, GRANT)
    await link.hears(wire.Granted(5))
    orders.handle(link, GRANT)
    assert link.reports == [wire.Granted(5), wire.Granted(5)]
    assert len(disk.saved) == 1


async def test_a_revoke_behind_its_own_grant_wins(orders, core, disk):
    link = Wire(1)
    orders.handle(link, GRANT)
    orders.handle(link, wire.Revoke(5, "taken over"))
    disk.free.set()
    await link.hears(wire.Granted(5))
    assert core.lease.current is None
    assert asks_to_move(core, 5).code == "no_lease"


async def test_page_lost_during_the_grants_write_restarts_numbering(orders, core, disk):
    link = Wire(1)
    orders.handle(link, GRANT)
    orders.handle(link, wire.Pause(5, "The page is gone."))
    disk.free.set()
    await link.hears(wire.Granted(5))
    assert asks_to_move(core, 5) is None
    orders.handle(link, GRANT)
    assert asks_to_move(core, 5) is None, "the page came back and begins with number 1 again"


async def test_page_is_paused_only_by_the_link_of_its_grant(orders, core, disk):
    left, back = Wire(1), Wire(2)
    disk.free.set()
    orders.handle(left, GRANT)
    await left.hears(wire.Granted(5))
    orders.handle(back, GRANT)
    assert core.drive(wire.Drive(fence=5, seq=9, sent_ms=0.0, x=0.0, w=0.0), 2, 100.0) is None
    orders.handle(left, wire.Pause(5, "The page is gone."))
    assert core.state(100.0, []).seq == 9, "it counts on"
    orders.handle(back, wire.Pause(5, "The page is gone."))
    assert core.state(100.0, []).seq is None


async def test_older_holder_is_revoked_during_the_next_fences_write(orders, core, disk):
    link = Wire(1)
    disk.free.set()
    orders.handle(link, GRANT)
    await link.hears(wire.Granted(5))
    disk.free.clear()
    orders.handle(link, wire.Grant(6, 60.0, "session-6", "Bob", "bob-id", 1.0))
    orders.handle(link, wire.Revoke(5, "taken over"))
    assert core.lease.current is None


async def test_higher_of_two_fences_being_written_gets_control(orders, core, disk):
    link = Wire(1)
    orders.handle(link, GRANT)
    orders.handle(link, wire.Grant(6, 60.0, "session-6", "Bob", "bob-id", 1.0))
    disk.free.set()
    await link.hears(wire.Granted(6))
    assert [type(report) for report in link.reports] == [wire.Refused, wire.Granted]
    assert link.reports[0].refusal.code == "old_fence"
    assert [state.fence for state in disk.saved] == [5, 6]


async def test_a_link_that_is_gone_gets_nothing(orders, core, disk):
    gone, there = Wire(1), Wire(2)
    orders.handle(gone, GRANT)
    orders.forget(gone)
    orders.handle(there, GRANT)
    disk.free.set()
    await there.hears(wire.Granted(5))
    assert (core.lease.link, gone.reports) == (2, [])


async def test_a_number_that_cannot_be_written_is_not_given(orders, core, disk):
    link = Wire(1)
    disk.fails = True
    disk.free.set()
    orders.handle(link, GRANT)
    await asyncio.wait_for(link.news.wait(), 10)
    (refused,) = link.reports
    assert refused.refusal.code == "state_not_saved"
    assert "No space left on device" in refused.refusal.text
    disk.fails = False
    orders.handle(link, GRANT)
    await link.hears(wire.Granted(5))


async def test_a_stop_over_the_same_link_does_not_wait_for_the_disk(orders, core, disk, tmp_path):
    recorder = RecorderClient(core.config, Bench().records)
    door = LinkHandler(core, orders, InspectorClient(core.config, lambda: None), {}, recorder)
    address = LinkAddress(unix_path=str(tmp_path / "b.sock"))
    server = LinkServer(address, door.opened, door.received, door.closed)
    await server.start()
    link = BridgeLink(UUID(core.config.robot_id), address)
    link.subscribe(follower := Follower())
    try:
        await follower.until("up")
        granted = asyncio.ensure_future(link.grant(GRANT, 10.0))
        await asyncio.to_thread(disk.reached.wait, 10)
        stopped = await link.stop(wire.LinkStop("Ann"))
        assert stopped.stop.state == "stopping"
        assert not granted.done()
        disk.free.set()
        await granted
    finally:
        disk.free.set()
        await link.close()
        await server.close()
