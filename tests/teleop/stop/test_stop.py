"""Emergency stop: by every person who may see the robot, at once, independent of the database."""

import asyncio
import threading
import time
from concurrent.futures import Future
from uuid import uuid4

import pytest

import robots.link.client
from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.models import Record
from robots.link.client import LinkRefused, links
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared import wire
from teleop.background import database
from teleop.background.database import in_database
from teleop.live.consumers.message_socket import FLOOD_BURST, FLOOD_CLOSES_AFTER
from teleop.records.repeat_suppression import MOST, RepeatSuppressor
from teleop.stop import emergency_stop
from tests.teleop.support import eventually, unavailable

pytestmark = pytest.mark.django_db(transaction=True)


def rows(kind):
    return list(Record.objects.filter(kind=kind).select_related("actor").order_by("id"))


def records(kind):
    return in_database(lambda: rows(kind))


def recorded(kind, count):
    """Wait for `count` records of a kind: a stop is reported first, then recorded in the background."""
    return eventually(lambda: found if len(found := rows(kind)) >= count else None)


@pytest.mark.parametrize("who", ["observer", "operator", "supervisor", "staff"])
async def test_every_person_who_sees_the_robot_may_stop_it(open_page, bridge, who):
    page = await open_page(who)
    await page.say("stop")
    await bridge.hears(wire.LinkStop)


async def test_stop_needs_no_hello(open_page, bridge):
    page = await open_page("observer", hello=False)
    await page.say("stop")
    assert (await bridge.hears(wire.LinkStop)).by == "Obi Observer"


async def test_stop_and_its_result_are_recorded(open_page, bridge, observer):
    page = await open_page("observer")
    await page.say("stop")
    pressed, outcome = await recorded("stop.press", 2)
    assert pressed.actor_id == str(observer.id)
    assert (outcome.of_id, outcome.outcome) == (pressed.id, "stopping")


async def test_stop_is_recorded_with_the_session_it_interrupts(open_page, bridge):
    holder, other = await open_page("operator"), await open_page("observer")
    control = await holder.take()
    await other.say("stop")
    for record in await recorded("stop.press", 2):
        assert (str(record.session_id), record.fence) == (control["session"], control["fence"])


async def test_stop_is_delivered_though_the_page_closes(open_page, bridge):
    page = await open_page("observer")
    await page.say("stop")
    await page.close()
    await bridge.hears(wire.LinkStop)


async def test_stop_does_not_wait_for_the_database(open_page, bridge, monkeypatch):
    answered = threading.Event()
    page = await open_page("observer")
    monkeypatch.setattr(audit, "record", lambda *_args, **_kwargs: answered.wait(10))
    try:
        await page.say("stop")
        await bridge.hears(wire.LinkStop)
    finally:
        answered.set()


async def test_stop_works_when_it_cannot_be_recorded(open_page, bridge, monkeypatch):
    page = await open_page("observer")
    monkeypatch.setattr(audit, "record", unavailable)
    await page.say("stop")
    await bridge.hears(wire.LinkStop)


async def test_stop_is_accepted_during_a_flood(open_page, bridge):
    page = await open_page("observer")
    for _ in range(700):
        await page.say("ping", sent_ms=1)
    await page.say("stop")
    await bridge.hears(wire.LinkStop)


def recorded_presses(count):
    """Return (times, outcome) of each record as soon as `count` presses are recorded."""

    def presses():
        found = rows("stop.press")
        outcomes = {record.of_id: record.outcome for record in found if record.of_id}
        found_presses = [(r.parameters.get("times", 1), outcomes.get(r.id)) for r in found if not r.of_id]
        all_there = sum(times for times, _ in found_presses) >= count and all(
            outcome for _, outcome in found_presses
        )
        return found_presses if all_there else None

    return eventually(presses)


async def test_every_press_is_sent_but_few_are_recorded(open_page, bridge, monkeypatch):
    monkeypatch.setattr(emergency_stop, "GAP_S", 1.0)
    page = await open_page("observer")
    for number in range(1, 31):
        await page.say("stop")
        await bridge.hears(wire.LinkStop, count=number)
        await page.say("ping", sent_ms=number)  # by then the bridge's answer has usually arrived
        await page.hears("pong")
    found_presses = await recorded_presses(30)
    assert {outcome for _, outcome in found_presses} == {"stopping"}
    assert sum(times for times, _ in found_presses) == 30
    assert len(found_presses) <= 4


async def test_stop_after_a_clear_is_no_repeat(open_page, bridge, robot, monkeypatch):
    """The stop is recorded at once, with the control session that it interrupts."""
    monkeypatch.setattr(emergency_stop, "GAP_S", 60.0)
    holder, page = await open_page("operator"), await open_page("observer")
    link = links.get(robot.id, link_address(robot))
    for number in (1, 2):
        await page.say("stop")
        assert await recorded_presses(number) == [(1, "stopping")] * number
        await page.say("stop")  # a repeat, although the robot's state is older and still clear
        await bridge.hears(wire.LinkStop, count=2 * number)
        bridge.tells_stop("stopped")
        await eventually(lambda: link.state.stop.state == "stopped")
        if number == 1:
            bridge.tells_stop("clear")
            await eventually(lambda: link.state.stop.state == "clear")
            control = await holder.take()
    first, second = [record for record in await records("stop.press") if not record.of_id]
    assert (first.session_id, str(second.session_id)) == (None, control["session"])
    await asyncio.to_thread(emergency_stop.press_records.flush)
    assert [times for times, _ in await recorded_presses(4)] == [1, 1, 1, 1]


async def test_presses_by_form_share_records_too(browsers, bridge, monkeypatch):
    monkeypatch.setattr(emergency_stop, "GAP_S", 1.0)
    for _ in range(10):
        assert (await post(browsers["observer"], "/api/v1/stop/")).status_code == 200
    assert len(bridge.all(wire.LinkStop)) == 10
    found_presses = await recorded_presses(10)
    assert sum(times for times, _ in found_presses) == 10
    assert len(found_presses) <= 4


async def test_press_after_a_pause_has_its_own_record(open_page, bridge, monkeypatch):
    monkeypatch.setattr(emergency_stop, "GAP_S", 0.1)
    page = await open_page("observer")
    for count in (1, 2):
        await page.say("stop")
        assert await recorded_presses(count) == [(1, "stopping")] * count
        await eventually(lambda: not emergency_stop.press_records._waiting)


async def test_stops_are_never_refused_for_their_number(open_page, bridge):
    page = await open_page("observer")
    for _ in range(int(FLOOD_BURST) + FLOOD_CLOSES_AFTER + 500):
        await page.say("stop")
    await page.say("ping", sent_ms=1)
    message = await page.hears("refused")  # the stops count towards the flood limit
    assert (message["of"], message["refusal"]["code"]) == ("ping", "flood")


class SilentLink:
    """A link whose bridge answers a stop only when the test lets it."""

    state = None

    def __init__(self, robot):
        self.robot_id = robot.id
        self.sent = []
        self.answers = []

    def send(self, message):
        self.sent.append(message)
        return True

    async def stop(self, message):
        self.sent.append(message)
        self.answers.append(asyncio.get_running_loop().create_future())
        return await self.answers[-1]


async def test_presses_of_a_flood_become_one_more_press(robot, observer):
    link, button = SilentLink(robot), emergency_stop.StopButton(observer, "robot page", None)
    button.press(link)
    await eventually(lambda: link.answers)
    for _ in range(5):
        button.press(link, flood=True)
    assert len(link.sent) == 1
    link.answers[0].set_result(wire.Stopped(wire.StopState("stopping")))
    await eventually(lambda: len(link.answers) == 2)
    link.answers[1].set_result(wire.Stopped(wire.StopState("stopping")))
    await recorded_presses(6)
    assert len(link.sent) == 2


async def test_press_without_bridge_is_reported(open_page, bridge):
    page = await open_page("observer")
    await bridge.close()
    await page.hears("bridge_gone")
    await page.say("stop")
    refused = (await page.refused("pending"))["refusal"]
    assert refused["text"].endswith(" Use the red button on the robot.")
    assert refused["figures"] == {"because": "bridge_down"}


async def test_every_page_shows_a_pending_stop(open_page, bridge):
    presser, other = await open_page("observer"), await open_page("operator")
    await bridge.close()
    assert (await other.hears("bridge_gone"))["stop"] is None
    await presser.say("stop")
    await presser.refused("pending")
    gone = await other.hears("bridge_gone")
    assert (gone["stop"]["by"], gone["refusal"]["code"]) == ("Obi Observer", "bridge_down")
    assert abs(gone["stop"]["at"] - time.time()) < 60.0


async def test_result_is_reported_before_the_database_answers(open_page, bridge, monkeypatch):
    answered = threading.Event()
    page = await open_page("observer")
    await bridge.close()
    await page.hears("bridge_gone")
    monkeypatch.setattr(audit, "record", lambda *_args, **_kwargs: answered.wait(10))
    try:
        await page.say("stop")
        await page.refused("pending")
        await page.say("stop")  # the person may press again
        await page.refused("pending")
    finally:
        answered.set()


async def test_press_during_a_delivery_without_link_is_sent_too(open_page, bridge, monkeypatch):
    pressed = []
    first, second = asyncio.Event(), asyncio.Event()

    async def not_reached(*_args):
        pressed.append(True)
        (second if first.is_set() else first).set()
        await second.wait()
        raise LinkRefused(wire.Refusal("bridge_down", "The robot's bridge is not running.", "robot"))

    page = await open_page("observer")
    await bridge.close()
    await page.hears("bridge_gone")
    monkeypatch.setattr(robots.link.client, "ask_bridge", not_reached)
    await page.say("stop")
    await asyncio.wait_for(first.wait(), 10)
    await page.say("stop")
    await page.say("ping", sent_ms=1)
    await page.hears("pong")
    second.set()
    await page.refused("pending")
    assert len(pressed) >= 2


async def test_slow_found_pressesof_stops_do_not_delay_rights(open_page, bridge, monkeypatch):
    begun, answered = threading.Semaphore(0), threading.Event()

    def slow(*_args, **_kwargs):
        begun.release()
        answered.wait(10)

    pages = [await open_page(who) for who in ("observer", "operator", "supervisor", "staff", "second")]
    monkeypatch.setattr(audit, "record", slow)
    monkeypatch.setattr(emergency_stop, "record_outcome", slow)
    try:
        for page in pages:
            await page.say("stop")
            await bridge.hears(wire.LinkStop)
        assert await asyncio.to_thread(begun.acquire, timeout=5)
        together = threading.Barrier(database._threads._max_workers)
        waits = [in_database(together.wait, 5) for _ in range(database._threads._max_workers)]
        await asyncio.gather(*waits)
    finally:
        answered.set()


def test_waiting_presses_are_written_at_the_end():
    wrote = []
    log = RepeatSuppressor(lambda press, times: wrote.append((press.robot_id, times)), most=None)
    presses = [
        emergency_stop.Press(User(username="p"), "rest", uuid4(), None, Future()) for _ in range(MOST + 10)
    ]
    for press in presses * 3:
        log.add(press)
    log.flush()
    for press in presses:
        assert sum(times for robot, times in wrote if robot == press.robot_id) == 3


# --- clear ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("who", ["supervisor", "staff"])
async def test_supervisors_and_staff_clear_without_control(open_page, bridge, who):
    page = await open_page(who)
    assert page.control["may_clear"]
    await page.say("clear", number=0)
    await bridge.hears(wire.LinkClear)


async def test_holder_clears_the_stop(open_page, bridge):
    page = await open_page("operator")
    assert (await page.take())["may_clear"]
    await page.say("clear", number=0)
    await bridge.hears(wire.LinkClear)
    assert (await records("stop.clear"))[0].actor_name == "Olga Operator"


@pytest.mark.parametrize("who", ["observer", "operator"])
async def test_other_people_may_not_clear_the_stop(open_page, bridge, who):
    page = await open_page(who)
    await page.say("clear", number=0)
    await page.refused("may_not_clear")
    assert not bridge.all(wire.LinkClear)


async def test_clear_names_the_shown_stop_and_its_refusal_is_sent(open_page, bridge):
    page = await open_page("staff")
    bridge.newest_stop = 8
    await page.say("clear", number=7)
    await page.refused("stopped_again")
    assert (await bridge.hears(wire.LinkClear)).number == 7


async def test_clear_without_stop_number_is_refused(open_page, bridge):
    page = await open_page("staff")
    await page.say("clear")
    await page.refused("invalid")
    assert not bridge.all(wire.LinkClear)


async def test_clear_that_cannot_be_recorded_is_not_sent(open_page, bridge, monkeypatch):
    page = await open_page("staff")
    monkeypatch.setattr(audit, "record", unavailable)
    await page.say("clear", number=0)
    await page.refused("audit_disk_full")
    assert not bridge.all(wire.LinkClear)


# --- without a live connection ----------------------------------------------------------------------


def post(browser, address, accept="*/*"):
    return in_database(lambda: browser.post(address, headers={"accept": accept}))


async def test_form_address_stops_the_robot(browsers, robot, bridge):
    answer = await post(browsers["observer"], f"/robots/{robot.slug}/stop/")
    assert answer.status_code == 200
    assert answer.json()["robots"][robot.slug]["stop"]["state"] == "stopping"
    assert (await bridge.hears(wire.LinkStop)).by == "Obi Observer"
    pressed = await recorded("stop.press", 2)
    assert [record.outcome for record in pressed] == ["", "stopping"]
    assert [record.robot_name for record in pressed] == ["TIAGo 1", "TIAGo 1"]


async def test_stop_all_names_the_robots_it_did_not_reach(browsers, robot, other_robot, bridge):
    answer = await post(browsers["staff"], "/stop-all/")
    assert answer.status_code == 202
    assert answer.json()["text"].startswith("Pending, not confirmed yet: TIAGo 2. ")
    assert "Use the red button on the robot." in answer.json()["text"]
    await bridge.hears(wire.LinkStop)
    await recorded("stop.press", 4)


async def test_stop_all_leaves_disabled_robots_out(browsers, robot, other_robot, bridge):
    await in_database(lambda: Robot.objects.filter(pk=other_robot.pk).update(enabled=False))
    assert (await post(browsers["staff"], "/stop-all/")).status_code == 200
    await recorded("stop.press", 2)


async def test_stop_all_without_robots_claims_no_stop(browsers, bridge):
    answer = await post(browsers["stranger"], "/stop-all/")
    expected = {"text": "There is no robot in service that you may stop.", "robots": {}}
    assert (answer.status_code, answer.json()) == (200, expected)
    assert not bridge.all(wire.LinkStop)


async def test_form_without_scripts_gets_a_page(browsers, robot, bridge):
    address = f"/robots/{robot.slug}/stop/"
    answer = await post(browsers["observer"], address, "text/html,application/xhtml+xml,*/*;q=0.8")
    assert (answer.status_code, "Stopped." in answer.text) == (200, True)
    assert f'href="/robots/{robot.slug}/"' in answer.text
    await recorded("stop.press", 2)


async def test_stranger_stops_nothing(browsers, robot, bridge):
    assert (await post(browsers["stranger"], f"/robots/{robot.slug}/stop/")).status_code == 404
    assert not bridge.all(wire.LinkStop)
