"""The fleet page: cards, stop all, clear."""

import asyncio
import threading
import time
from datetime import timedelta

import msgspec
import pytest
import pytest_asyncio
from django.utils import timezone

from fleet.audit.models import Record
from fleet.bookings.models import OutOfService
from robots.link import client as robots_link
from robots.registry.models import Robot, RobotRole
from robots.shared import wire
from teleop.background.database import in_database
from teleop.live.consumers import fleet_consumer
from teleop.live.consumers.message_socket import FLOOD_BURST, FLOOD_CLOSES_AFTER, CloseCode
from teleop.live.fleet import board, cards, sights
from tests.teleop.support import IDLE, FakeBridge, Page

pytestmark = pytest.mark.django_db(transaction=True)


@pytest_asyncio.fixture
async def open_fleet(browsers, websocket_headers, bridge):
    """`await open_fleet("staff")`: that person's fleet page."""
    opened = []

    async def open_one(who):
        page = await Page(websocket_headers(browsers[who]), "/ws/fleet/").open()
        opened.append(page)
        return page

    yield open_one
    for page in opened:
        await page.close()


@pytest_asyncio.fixture
async def other_bridge(other_robot):
    """The bridge of `other_robot`."""
    running = await FakeBridge(other_robot).start()
    yield running
    await running.close()


async def shows(page, fits):
    """Acknowledge updates until all robots, as the page shows them then, fit; return them."""
    while True:
        missed = [message for message in page.inbox if message["t"] == "fleet"]
        page.inbox = [message for message in page.inbox if message["t"] != "fleet"]
        update = (
            missed[0] if missed else await page.hears("fleet")
        )  # at most one waits for its acknowledgement
        page.robots = {**(page.robots if update["changed"] else {}), **update["robots"]}
        await page.say("ack")
        if fits(page.robots):
            return page.robots


async def test_page_has_a_card_for_each_visible_robot(open_fleet, robot, other_robot):
    assert list(await shows(await open_fleet("observer"), lambda _: True)) == [robot.slug]
    assert list(await shows(await open_fleet("staff"), lambda _: True)) == [robot.slug, other_robot.slug]
    assert await shows(await open_fleet("stranger"), lambda _: True) == {}


async def test_card_shows_the_state_or_why_it_is_unknown(open_fleet, robot, other_robot):
    page = await open_fleet("staff")
    robots = await shows(page, lambda robots: robots[robot.slug]["state"])
    assert robots[robot.slug]["state"]["phase"] == "online"
    assert robots[other_robot.slug]["refusal"]["code"] == "bridge_down"


async def test_a_fault_of_one_entry_is_shown_on_its_card_alone(
    open_fleet, robot, other_robot, bridge, monkeypatch
):
    def fails(entry):
        if entry.pk == other_robot.pk:
            raise TypeError
        return None

    monkeypatch.setattr(sights, "out_of_service", fails)
    robots = await shows(await open_fleet("staff"), lambda robots: robots[robot.slug]["state"])
    assert robots[other_robot.slug]["refusal"]["code"] == "link_fault"


async def test_card_of_a_silent_bridge_is_unknown(open_fleet, robot, bridge, monkeypatch):
    """A frozen bridge: its last state is outdated."""
    page = await open_fleet("observer")
    await shows(page, lambda robots: robots[robot.slug]["state"])
    monkeypatch.setattr(robots_link, "SILENT_S", 0.2)
    silent = (await shows(page, lambda robots: not robots[robot.slug]["state"]))[robot.slug]
    assert silent["refusal"]["code"] == "bridge_silent"
    bridge.say(wire.Status(IDLE))
    await shows(page, lambda robots: robots[robot.slug]["state"])


async def test_a_card_that_cannot_be_made_is_unknown_not_old(open_fleet, robot, bridge, monkeypatch):
    page = await open_fleet("observer")
    await shows(page, lambda robots: robots[robot.slug]["state"])
    with monkeypatch.context() as broken:
        broken.setattr(cards, "fleet_state", lambda _state: 1 / 0)
        bridge.say(wire.Status(msgspec.structs.replace(IDLE, holder="Olga Operator")))
        robots = await shows(page, lambda robots: not robots[robot.slug]["state"])
    assert robots[robot.slug]["refusal"]["code"] == "link_fault"


async def test_disabled_robot_is_shown_as_such(open_fleet, robot, bridge):
    await in_database(lambda: Robot.objects.update(enabled=False))
    await bridge.close()
    page = await open_fleet("staff")
    robots = await shows(page, lambda robots: robots[robot.slug]["refusal"]["code"] == "robot_disabled")
    assert (robots[robot.slug]["out"]["code"], robots[robot.slug]["free_in_s"]) == ("robot_disabled", None)


async def test_out_of_service_is_on_the_card_of_a_robot_that_answers(open_fleet, robot, bridge):
    page = await open_fleet("staff")
    await shows(page, lambda robots: robots[robot.slug]["state"] and robots[robot.slug]["out"] is None)
    begins = timezone.now() - timedelta(hours=1)
    await in_database(lambda: OutOfService.objects.create(robot=robot, starts_at=begins, why="repair"))
    robots = await shows(page, lambda robots: robots[robot.slug]["out"])
    assert "out of service until further notice" in robots[robot.slug]["out"]["text"]


async def test_change_is_shown_at_once(open_fleet, robot, bridge):
    page = await open_fleet("observer")
    await shows(page, lambda robots: robots[robot.slug]["state"])
    bridge.say(wire.Status(msgspec.structs.replace(IDLE, holder="Olga Operator")))
    robots = await shows(page, lambda robots: robots[robot.slug]["state"]["holder"])
    assert robots[robot.slug]["state"]["holder"] == "Olga Operator"


async def test_fault_in_reading_or_sending_ends_no_page(open_fleet, robot, bridge, monkeypatch):
    monkeypatch.setattr(board, "RIGHTS_S", 0.05)
    page = await open_fleet("observer")
    await shows(page, lambda robots: robots[robot.slug]["state"])
    looked, made, shown = (threading.Semaphore(0) for _ in range(3))

    def fails(fault):
        fault.release()
        raise RuntimeError("a fault of ours")

    with monkeypatch.context() as broken:
        broken.setattr(board, "sights_of", lambda *_: fails(looked))
        broken.setattr(cards, "fleet_state", lambda _state: fails(made))
        for fault in (looked, looked, made):
            assert await asyncio.to_thread(fault.acquire, timeout=5)
    await shows(page, lambda robots: not robots[robot.slug]["state"])  # read, so that the next news are sent
    await shows(page, lambda robots: robots[robot.slug]["state"])
    with monkeypatch.context() as broken:
        broken.setattr(cards.RobotCard, "encoded", lambda *_: fails(shown))
        bridge.say(wire.Status(msgspec.structs.replace(IDLE, holder="Olga Operator")))
        assert await asyncio.to_thread(shown.acquire, timeout=5)
    await shows(page, lambda robots: robots[robot.slug]["state"]["holder"])


async def test_only_what_changed_is_sent(open_fleet, robot, bridge, other_robot, other_bridge, monkeypatch):
    monkeypatch.setattr(robots_link, "SILENT_S", 60.0)
    monkeypatch.setattr(fleet_consumer, "SLOW_S", 0.2)
    page = await open_fleet("staff")
    slugs = {robot.slug, other_robot.slug}
    await shows(page, lambda robots: all(robots[slug]["state"] for slug in slugs))
    at_rest = msgspec.structs.replace(IDLE, battery_percent=70.2, unseen_s=0.1)
    bridge.say(wire.Status(at_rest))
    await shows(page, lambda robots: robots[robot.slug]["state"]["battery_percent"] == 70)
    noise = msgspec.structs.replace(
        at_rest,
        odometry=wire.Odometry(5.0, 5.0, 1.0, 0.001, 0.0, -0.001),
        battery_percent=69.8,
        unseen_s=0.3,
        sensors=[wire.Sensor("/scan", "scan", True, 0.05)],
    )
    bridge.say(wire.Status(noise))
    for _ in range(4):
        await page.hears("beat")
    assert all(message["t"] == "beat" for message in page.inbox), page.inbox
    other_bridge.say(wire.Status(msgspec.structs.replace(IDLE, holder="Olga Operator")))
    update = await page.hears("fleet")
    assert (list(update["robots"]), update["changed"]) == ([other_robot.slug], True)
    await page.say("ack")
    bridge.say(wire.Status(msgspec.structs.replace(noise, unseen_s=0.5)))
    assert (await page.hears("fleet"))["robots"][robot.slug]["state"]["unseen_s"] == 0.5


async def test_next_update_waits_for_the_acknowledgement(open_fleet, bridge):
    page = await open_fleet("observer")
    await page.hears("fleet")
    await page.hears_nothing("fleet", within_s=1.5)


async def test_stop_all_stops_every_visible_robot(open_fleet, bridge, other_bridge):
    page = await open_fleet("staff")
    await page.hears("fleet")
    await page.say("stop_all")
    await bridge.hears(wire.LinkStop)
    await other_bridge.hears(wire.LinkStop)


async def test_stop_all_leaves_invisible_robots_alone(open_fleet, bridge, other_robot, other_bridge):
    staff = await open_fleet("staff")  # so that there is a link to the other robot
    await shows(staff, lambda robots: robots[other_robot.slug]["state"])
    page = await open_fleet("observer")
    await page.hears("fleet")
    await page.say("stop_all")
    await bridge.hears(wire.LinkStop)
    await staff.say("stop", slug=other_robot.slug)  # this message uses the same link after all earlier ones
    assert (await other_bridge.hears(wire.LinkStop)).by == "Sam Staff"


async def test_stop_all_names_each_robot_that_was_not_stopped(open_fleet, robot, bridge, other_robot, tiago):
    third = await in_database(
        lambda: Robot.objects.create(
            slug="tiago-3", name="TIAGo 3", profile=tiago, master_uri="http://127.0.0.1:9"
        )
    )
    page = await open_fleet("staff")
    await shows(page, lambda _: True)
    await page.say("stop_all")
    await bridge.hears(wire.LinkStop)
    refused = [(await page.hears("refused", of="stop"))["refusal"] for _ in range(2)]
    assert {refusal["figures"]["slug"] for refusal in refused} == {other_robot.slug, third.slug}
    assert {refusal["code"] for refusal in refused} == {"pending"}
    robots = await shows(
        page, lambda robots: robots[third.slug]["pending"] and robots[other_robot.slug]["pending"]
    )
    assert robots[third.slug]["pending"]["by"] == "Sam Staff"
    assert robots[robot.slug]["pending"] is None


async def test_stop_all_without_robots_is_refused(open_fleet, robot):
    await in_database(lambda: Robot.objects.filter(pk=robot.pk).update(enabled=False))
    for who in ("stranger", "observer"):
        page = await open_fleet(who)
        await page.say("stop_all")
        message = await page.refused("no_such_robot")
        assert message["refusal"]["text"] == "There is no robot in service that you may stop."


async def test_card_stops_its_robot(open_fleet, robot, bridge):
    page = await open_fleet("observer")
    await page.say("stop", slug=robot.slug)
    await bridge.hears(wire.LinkStop)
    await page.say("stop", slug="tiago-2")
    await page.refused("no_such_robot")


@pytest.mark.parametrize("what", [{"t": "ack"}, {"t": "stop", "slug": "no-such-robot"}])
async def test_flood_is_refused_and_closes_the_connection(open_fleet, what):
    page = await open_fleet("observer")
    for _ in range(int(FLOOD_BURST) + FLOOD_CLOSES_AFTER + 200):
        await page.say(**what)
    assert await page.is_closed() == CloseCode.FLOOD


async def test_removed_role_removes_the_card(open_fleet, robot, observer):
    page = await open_fleet("observer")
    await shows(page, lambda robots: robots)
    await in_database(lambda: RobotRole.objects.filter(user=observer).delete())
    await shows(page, lambda robots: not robots)


async def test_signing_out_elsewhere_closes_the_page(open_fleet, browsers, end_session):
    page = await open_fleet("observer")
    await in_database(end_session, browsers["observer"])
    assert await page.is_closed() == CloseCode.SIGNED_OUT


# --- clearing -------------------------------------------------------------------------------------------


async def stopped(bridge, slug, page, number=3):
    await shows(page, lambda robots: robots[slug]["state"])
    bridge.newest_stop = number
    bridge.tells_stop("stopped")
    return await shows(page, lambda robots: robots[slug]["state"]["stop"]["number"] == number)


async def test_supervisor_clears_each_robot_by_its_stop_number(open_fleet, bridge, robot):
    page = await open_fleet("supervisor")
    assert (await stopped(bridge, robot.slug, page))[robot.slug]["may_clear"] is True
    await page.say("clear", slug=robot.slug, number=3)
    assert (await bridge.hears(wire.LinkClear)).number == 3
    cleared = await in_database(lambda: Record.objects.get(kind="stop.clear", of=None))
    assert cleared.robot_id == robot.pk


async def test_clear_without_the_right_is_refused_and_not_sent(open_fleet, bridge, robot):
    page = await open_fleet("operator")
    assert (await stopped(bridge, robot.slug, page))[robot.slug]["may_clear"] is False
    await page.say("clear", slug=robot.slug, number=3)
    assert (await page.refused("may_not_clear"))["refusal"]["figures"]["slug"] == robot.slug
    await page.say("clear", slug="tiago-2", number=3)
    assert (await page.refused("no_such_robot"))["refusal"]["figures"]["slug"] == "tiago-2"
    assert not await in_database(Record.objects.filter(kind="stop.clear").exists)


async def test_card_of_a_robot_out_of_reach_shows_its_last_contact(open_fleet, bridge, robot):
    page = await open_fleet("observer")
    await shows(page, lambda robots: robots[robot.slug]["state"])
    bridge.say(wire.Status(msgspec.structs.replace(IDLE, phase="waiting", unseen_s=90.0)))
    robots = await shows(page, lambda robots: robots[robot.slug]["seen_at"])
    assert robots[robot.slug]["seen_at"] == pytest.approx(time.time() - 90, abs=10)
    await bridge.close()
    robots = await shows(page, lambda robots: robots[robot.slug]["state"] is None)
    assert robots[robot.slug]["seen_at"] == pytest.approx(time.time() - 90, abs=10)


async def test_pages_that_open_together_share_what_they_read(open_fleet, monkeypatch):
    """So hundreds of pages leave the database's threads to drivers and stops."""
    people = ["stranger", "staff"] * 10
    read, sights_of = [], board.sights_of

    def read_slowly(asked, stored):
        read.append(asked)
        while len(board.board.pages) < len(people):
            time.sleep(0.01)
        return sights_of(asked, stored)

    monkeypatch.setattr(board, "sights_of", read_slowly)
    monkeypatch.setattr(board, "RIGHTS_S", 60.0)
    for page in await asyncio.gather(*map(open_fleet, people)):
        await shows(page, lambda _: True)
    assert list(map(len, read)) == [1, 2]


async def test_no_card_stays_when_the_last_page_closes_during_a_read(open_fleet, robot, bridge, monkeypatch):
    page = await open_fleet("observer")
    reading, gone, sights_of = threading.Semaphore(0), threading.Event(), board.sights_of

    def read_slowly(asked, stored):
        reading.release()
        assert gone.wait(5)
        return sights_of(asked, stored)

    monkeypatch.setattr(board, "sights_of", read_slowly)
    assert await asyncio.to_thread(reading.acquire, timeout=5)
    await page.close()
    assert not board.board.pages
    gone.set()
    async with board.board._reading:
        assert not board.board._cards


async def test_card_of_each_person_has_their_own_rights(open_fleet, robot, bridge):
    pages = {who: await open_fleet(who) for who in ("operator", "supervisor", "staff")}
    may_clear = {
        who: (await shows(page, lambda robots: robots[robot.slug]["state"]))[robot.slug]["may_clear"]
        for who, page in pages.items()
    }
    assert may_clear == {"operator": False, "supervisor": True, "staff": True}
