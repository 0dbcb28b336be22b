"""Records of refusals: from every interface, repeats in one record, without delaying any answer."""

import json
import queue
import threading
import time
from concurrent.futures import Future
from uuid import uuid4

import pytest

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.background.database import in_database
from teleop.records import refusals, repeat_suppression
from teleop.records.refusals import RefusedRequest, write_record
from teleop.stop.emergency_stop import Press
from tests.teleop.support import TIMEOUT_S, Page, eventually

FORBIDDEN = Refusal("stopped", "The robot is stopped.", "stop", {"number": 3, "by": "Olga Operator"})
SOON_S = 0.1


@pytest.fixture
def written(monkeypatch):
    """A suppressor with short gaps; `next()` returns the next written event: (code, times)."""
    monkeypatch.setattr(refusals, "GAP_S", SOON_S)
    written_events = queue.Queue()
    log = repeat_suppression.RepeatSuppressor(
        lambda denied, times: written_events.put((denied.refusal.code, times))
    )
    log.next = lambda: written_events.get(timeout=TIMEOUT_S)
    yield log
    log.flush()


def denied(person=None, code="stopped", robot=None, session=None):
    refusal = Refusal(code, "Not done.", "stop")
    return RefusedRequest(
        person or User(username="p"), "robot page", "drive", refusal, robot, session_id=session
    )


# --- repeats ------------------------------------------------------------------------------------------


def test_first_is_written_at_once_and_repeats_in_one_record(written, monkeypatch):
    monkeypatch.setattr(refusals, "GAP_S", 3 * SOON_S)
    person = User(username="p")
    written.add(denied(person))
    assert written.next() == ("stopped", 1)
    for _ in range(37):
        written.add(denied(person))
    assert written.next() == ("stopped", 37)


def test_different_people_robots_and_codes_are_no_repeats(written):
    person, robot = User(username="p"), uuid4()
    for other in (
        denied(person),
        denied(),
        denied(person, robot=robot),
        denied(person, robot=robot, session=uuid4()),
        denied(person, "too_old"),
    ):
        written.add(other)
    assert [written.next()[1] for _ in range(5)] == [1] * 5


def test_refusals_beyond_a_persons_budget_are_counted(monkeypatch):
    monkeypatch.setattr(refusals, "GAP_S", SOON_S)
    written_events = []
    log = repeat_suppression.RepeatSuppressor(
        lambda denied, times: written_events.append((denied.person, times)), most=None
    )
    person, other = User(username="p"), User(username="q")
    for _ in range(3):
        for number in range(100):
            log.add(denied(person, f"code_{number}"))
    log.add(denied(other))
    assert_soon(lambda: (other, 1) in written_events)
    assert len([who for who, _ in written_events if who is person]) <= repeat_suppression.RECORDS_BURST + 1
    log.flush()
    assert sum(times for who, times in written_events if who is person) == 300


def test_waiting_refusals_do_not_take_the_places_of_others():
    written_events = []
    log = repeat_suppression.RepeatSuppressor(lambda denied, times: written_events.append(denied.person))
    person, other = User(username="p"), User(username="q")
    for number in range(2 * repeat_suppression.MOST):
        log.add(denied(person, f"code_{number}"))
    log.add(denied(other))
    assert_soon(lambda: other in written_events)
    log.flush()
    assert len(written_events) <= repeat_suppression.MOST_PER_PERSON + repeat_suppression.RECORDS_BURST + 1


def test_press_that_stopped_a_robot_is_written_at_once():
    written_events = []
    log = repeat_suppression.RepeatSuppressor(
        lambda press, times: written_events.append((press.first_press, times)), most=None
    )
    person = User(username="p")
    fresh = uuid4()
    for _ in range(100):
        log.add(Press(person, "rest", uuid4(), None, Future()))
    assert_soon(lambda: len(written_events) >= repeat_suppression.RECORDS_BURST)
    log.add(Press(person, "fleet page", uuid4(), fresh, Future()))
    assert_soon(lambda: (fresh, 1) in written_events)
    log.flush()
    assert len(written_events) == 101


def assert_soon(holds):
    end_s = time.monotonic() + TIMEOUT_S
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def test_refusal_after_a_pause_is_written_at_once(written):
    person = User(username="p")
    written.add(denied(person))
    written.next()
    written._thread.join(TIMEOUT_S)  # it ends when no event is waiting
    written.add(denied(person))
    assert written.next() == ("stopped", 1)


def test_flood_of_late_commands_is_one_record(written):
    late = denied(code="too_old")
    written.add(late)
    written.next()
    written.add(late)
    written.add(denied())
    assert written.next() == ("stopped", 1)
    assert written._waiting[late.key].due_s - time.monotonic() > 100 * SOON_S


def test_refusal_does_not_wait_for_the_database():
    begun, go_on = threading.Event(), threading.Event()

    def hang(_denied, _times):
        begun.set()
        assert go_on.wait(TIMEOUT_S)

    log = repeat_suppression.RepeatSuppressor(hang)
    log.add(denied())
    assert begun.wait(TIMEOUT_S)
    for _ in range(repeat_suppression.MOST + 10):  # returns while the database hangs
        log.add(denied())
    assert len(log._waiting) == repeat_suppression.MOST
    go_on.set()
    log.flush()


# --- the record ---------------------------------------------------------------------------------------


@pytest.mark.django_db(transaction=True)
def test_record_has_code_rule_figures_and_names_expire(operator, robot):
    session = uuid4()
    refused = RefusedRequest(operator, "robot page", "drive", FORBIDDEN, robot.id, robot.name, session, 7)
    write_record(refused, 12)
    record = Record.objects.get(kind="refusal")
    assert (record.outcome, record.actor_id, record.robot_id) == ("stopped", str(operator.pk), robot.id)
    assert (record.session_id, record.fence) == (session, 7)
    facts = {"rule": "stop", "of": "drive", "through": "robot page", "figures": {"number": 3}, "times": 12}
    assert record.parameters == facts
    assert record.details == {**facts, "words": FORBIDDEN.text, "figures": FORBIDDEN.figures}


@pytest.mark.django_db(transaction=True)
def test_refusal_that_cannot_be_recorded_is_logged(operator, monkeypatch, caplog):
    full = AuditUnavailable("audit_disk_full", "Not done: the disk is full.")

    def fail(*_args, **_kwargs):
        raise full

    monkeypatch.setattr("fleet.audit.services.record", fail)
    write_record(denied(operator), 3)
    assert "3 refusals (stopped)" in caplog.text


# --- interfaces ---------------------------------------------------------------------------------------


async def on_record(code):
    record = await eventually(lambda: Record.objects.filter(kind="refusal", outcome=code).first())
    return record.actor_id, record.robot_name, record.parameters["through"], record.parameters["of"]


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize(
    ("message", "code"),
    [
        ({"t": "take"}, "role_too_low"),
        ({"t": "clear", "number": 1}, "may_not_clear"),
        ({"t": "drive", "fence": 1, "seq": 1, "sent_ms": 1.0, "x": 0.5, "w": 0.0, "share": 0.5}, "no_lease"),
        ({"t": "say", "fence": 1, "seq": 1, "text": "Hello.", "language": "en-GB"}, "no_lease"),
        ({"t": "dance"}, "invalid"),
    ],
)
async def test_refusal_on_the_robot_page_is_recorded(message, code, open_page, observer):
    page = await open_page("observer")
    await page.say_raw(json.dumps(message))
    await page.refused(code)
    assert await on_record(code) == (str(observer.pk), "TIAGo 1", "robot page", message["t"])


@pytest.mark.django_db(transaction=True)
async def test_refusal_by_the_bridge_is_recorded_with_its_session(open_page, bridge):
    page = await open_page("operator")
    control = await page.take()
    bridge.say(wire.Refused("drive", FORBIDDEN, 1, control["fence"]))
    await page.refused("stopped")
    record = await eventually(lambda: Record.objects.filter(kind="refusal").first())
    assert (record.outcome, record.fence, str(record.session_id)) == (
        "stopped",
        control["fence"],
        control["session"],
    )


@pytest.mark.django_db(transaction=True)
async def test_refusal_on_the_topics_page_is_recorded(robot, browsers, websocket_headers, bridge, supervisor):
    page = await Page(websocket_headers(browsers["supervisor"]), f"/ws/robots/{robot.slug}/topics/").open()
    await page.say("call", service="/clear_costmaps", fields={}, seq=1)
    await page.refused("role_too_low")
    assert await on_record("role_too_low") == (str(supervisor.pk), "TIAGo 1", "topics", "call")
    await page.close()


@pytest.mark.django_db(transaction=True)
async def test_refusal_on_the_fleet_page_is_recorded(robot, browsers, websocket_headers, bridge, staff):
    page = await Page(websocket_headers(browsers["staff"]), "/ws/fleet/").open()
    await page.say("stop", slug="no-such-robot")
    await page.refused("no_such_robot")
    assert await on_record("no_such_robot") == (str(staff.pk), "", "fleet page", "stop")
    await page.close()


@pytest.mark.django_db(transaction=True)
async def test_refusal_by_rest_is_recorded(browsers, robot, stranger):
    asked = await in_database(browsers["stranger"].post, f"/api/v1/robots/{robot.slug}/stop/")
    assert asked.status_code == 404
    who, _, through, of = await on_record("not_found")
    assert (who, through) == (str(stranger.pk), "rest")
    assert of.startswith("POST ") and robot.slug not in of
