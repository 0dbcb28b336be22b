"""Control on live pages: taking, keeping, handing over and losing it."""

import asyncio
import threading
import time
from contextlib import asynccontextmanager
from datetime import timedelta
from functools import partial

import pytest
from django.db import OperationalError
from django.db.models import F
from django.utils import timezone
from msgspec import structs

import robots.link.client
from fleet.audit import services as audit
from fleet.audit.models import Record
from fleet.bookings.models import Booking, OutOfService
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.link.client import BridgeLink
from robots.registry.models import Robot
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.background.database import in_database
from teleop.control import lease_checks, services
from teleop.control.database_watch import GAP_S, DatabaseWatch
from teleop.control.lease_checks import Tab
from teleop.control.lease_events import LeaseEvents
from teleop.control.rules import WARNING
from teleop.control.waiting import line
from teleop.live import control_holder, robot_hub
from teleop.live.consumers.message_socket import CloseCode
from teleop.models import ControlSession, EndReason, Lease
from tests.teleop.support import eventually, unavailable

pytestmark = pytest.mark.django_db(transaction=True)


def drive(fence, seq=1):
    return {"fence": fence, "seq": seq, "sent_ms": 5.0, "x": 0.5, "w": 0.0}


def away(*_args, **_kwargs):
    """Replaces a query when the database does not answer."""
    raise OperationalError("the database is away")


def moves_on(**fields):
    """Change the lease as if time had passed."""
    return in_database(lambda: Lease.objects.update(**fields))


def count(kind):
    return in_database(lambda: Record.objects.filter(kind=kind).count())


# --- take -----------------------------------------------------------------------------------------


async def test_taking_a_free_robot_gives_control_and_drive(open_page, bridge):
    page = await open_page("operator")
    assert page.control["state"] == "free"

    control = await page.take()
    grant = await bridge.hears(wire.Grant)
    assert (grant.fence, grant.session, grant.holder) == (
        control["fence"],
        control["session"],
        "Olga Operator",
    )

    command = f'{{"t":"drive","fence":{grant.fence},"seq":1,"sent_ms":5.25,"x":0.5,"w":0}}'
    await page.say_raw(command)
    await bridge.hears(wire.Drive)
    assert command.encode() in bridge.raw  # forwarded unchanged


async def test_grant_contains_the_delay_to_the_drivers_page(open_page, bridge):
    page = await open_page("operator")
    await page.take()
    assert (await bridge.hears(wire.Grant)).delay_s is None, "no view was drawn yet"
    bridge.show(1)
    await page.hears("view")
    await page.say("ack")
    message = await bridge.hears(wire.Grant, lambda grant: grant.delay_s is not None)
    assert 0.0 < message.delay_s < 5.0


async def test_grant_contains_the_silence_of_the_drivers_page(open_page, bridge):
    page = await open_page("operator")
    await page.take()
    assert (await bridge.hears(wire.Grant)).silent_s < 1.0
    message = await bridge.hears(wire.Grant, lambda grant: grant.silent_s > 1.0)
    assert message.silent_s < 5.0
    await page.say("ping", sent_ms=1.0)
    await bridge.hears(wire.Grant, lambda grant: grant.silent_s < message.silent_s)


async def test_welcome_names_the_person_and_the_robots_facts(open_page, robot):
    page = await open_page("operator")
    assert (page.welcome["you"], page.welcome["role"]) == ("Olga Operator", "operator")
    assert page.welcome["robot"]["slug"] == robot.slug


async def test_other_pages_see_the_holder_and_the_time_left(open_page):
    watching = await open_page("observer")
    await (await open_page("operator")).take()
    message = await watching.hears("control", state="other")
    assert message["holder"] == "Olga Operator"
    assert message["fence"] is None
    assert 890 < message["remaining_s"] <= 900
    assert message["refusal"]["code"] == "role_too_low"


async def test_second_taker_is_refused_with_the_holders_name(open_page):
    await (await open_page("operator")).take()
    late = await open_page("second")
    await late.say("take")
    refusal = (await late.refused("held"))["refusal"]
    assert refusal["figures"]["holder"] == "Olga Operator"


async def test_grant_of_3_s_is_renewed_every_second(open_page, bridge):
    await (await open_page("operator")).take()
    renewed = await bridge.hears(wire.Grant, count=3)
    assert renewed.seconds == 3.0


async def test_internal_fault_does_not_end_the_renewal(open_page, bridge, monkeypatch):
    page = await open_page("operator")
    works, faults = BridgeLink.grant, iter([RuntimeError("a fault of ours")])

    async def fails_once(link, grant):
        for fault in faults:
            raise fault
        await works(link, grant)

    monkeypatch.setattr(BridgeLink, "grant", fails_once)
    await page.take()
    await bridge.hears(wire.Grant, count=2)


async def test_control_that_cannot_be_recorded_is_not_granted(open_page, bridge, monkeypatch):
    page = await open_page("operator")
    monkeypatch.setattr(audit, "record", unavailable)
    await page.say("take")
    await page.refused("audit_disk_full")
    await page.say("ping", sent_ms=1)
    await page.hears("pong")
    assert not bridge.all(wire.Grant)


async def test_full_disk_refuses_control_until_there_is_space(open_page, bridge, disk):
    page = await open_page("operator")
    await in_database(disk.fill)
    await page.say("take")
    refused = await page.refused("audit_disk_full")
    assert "the disk of the database is full" in refused["refusal"]["text"]
    await page.say("ping", sent_ms=1)
    await page.hears("pong")
    assert not bridge.all(wire.Grant)
    assert not await in_database(ControlSession.objects.exists)
    assert not await in_database(Lease.objects.exclude(session=None).exists)
    await in_database(disk.free)
    await page.take()
    await bridge.hears(wire.Grant)


async def test_robot_out_of_reach_cannot_be_taken(open_page, bridge):
    page = await open_page("operator")
    await bridge.close()
    await page.hears("bridge_gone")
    await page.say("take")
    await page.refused("bridge_down")
    assert await in_database(ControlSession.objects.count) == 0


async def test_control_refused_by_the_bridge_ends_with_its_reason(open_page, bridge):
    bridge.refuses = Refusal("old_fence", "Control number 1 is over.", "lease")
    page = await open_page("operator")
    await page.say("take")
    await page.hears("notice", code="old_fence")
    await page.hears("control", state="free")
    session = await in_database(ControlSession.objects.get)
    assert session.end_reason == EndReason.BRIDGE


async def test_fence_is_above_the_bridges_highest_fence(open_page, bridge):
    bridge.fence = 40
    page = await open_page("operator")
    assert (await page.take())["fence"] == 41


# --- release, ask, hand over, take over ---------------------------------------------------------------


async def test_release_revokes_at_the_bridge_and_frees_the_robot(open_page, bridge):
    page = await open_page("operator")
    fence = (await page.take())["fence"]
    await page.say("release")
    assert (await bridge.hears(wire.Revoke)).fence == fence
    await page.hears("control", state="free")
    await page.say("drive", **drive(fence))
    await page.refused("no_lease")
    assert not bridge.all(wire.Drive)


async def test_release_that_cannot_be_recorded_is_stored_later(open_page, bridge, monkeypatch):
    monkeypatch.setattr(control_holder, "RETRY_S", 0.05)
    page = await open_page("operator")
    fence = (await page.take())["fence"]
    with monkeypatch.context() as full:
        full.setattr(audit, "record", unavailable)
        await page.say("release")
        assert (await bridge.hears(wire.Revoke)).fence == fence
        await page.hears("control", state="free")
        await page.refused("audit_disk_full")
    session = await eventually(ControlSession.objects.filter(ended_at__isnull=False).first)
    assert session.end_reason == EndReason.RELEASED


async def test_holder_may_take_again_after_an_unstored_release(open_page, monkeypatch):
    monkeypatch.setattr(control_holder, "RETRY_S", 60.0)
    page = await open_page("operator")
    await page.take()
    with monkeypatch.context() as full:
        full.setattr(audit, "record", unavailable)
        await page.say("release")
        await page.hears("control", state="free")
        await page.say("take")
        await page.refused("audit_disk_full")
    await page.take()


async def test_take_after_an_unstored_release_is_kept(open_page, monkeypatch):
    monkeypatch.setattr(control_holder, "RETRY_S", 0.0)
    record, failed, trying, go_on = audit.record, threading.Event(), threading.Event(), threading.Event()

    def slow(kind, **facts):
        if kind == "control.end" and not failed.is_set():
            failed.set()
            unavailable()
        if kind == "control.end":
            trying.set()
            assert go_on.wait(10)
        return record(kind, **facts)

    page = await open_page("operator")
    given_back = (await page.take())["session"]
    monkeypatch.setattr(audit, "record", slow)
    await page.say("release")
    assert await asyncio.to_thread(trying.wait, 5)
    await page.say("take")
    await page.say("ping", sent_ms=1)
    await page.hears("pong")
    go_on.set()
    taken = (await page.hears("control", state="yours"))["session"]
    await page.hears_nothing("control")
    ended = await in_database(lambda: list(ControlSession.objects.values_list("id", "end_reason")))
    assert {str(session): reason for session, reason in ended} == {
        given_back: EndReason.RELEASED,
        taken: "",
    }


async def test_unstored_release_stays_after_a_reload(open_page, monkeypatch):
    page = await open_page("operator")
    await page.take()
    monkeypatch.setattr(control_holder, "RETRY_S", 0.5)
    with monkeypatch.context() as full:
        full.setattr(audit, "record", unavailable)
        await page.say("release")
        await page.refused("audit_disk_full")
    await page.close()
    await open_page("operator")
    session = await eventually(ControlSession.objects.filter(ended_at__isnull=False).first)
    assert session.end_reason == EndReason.RELEASED


async def test_end_of_right_that_cannot_be_stored_is_stored_later(open_page, bridge, monkeypatch):
    monkeypatch.setattr(control_holder, "RETRY_S", 0.05)
    page = await open_page("operator")
    bridge.refuses = Refusal("stale_fence", "There is a higher number.", "lease")
    with monkeypatch.context() as full:
        full.setattr(services, "_end_session", away)
        await page.say("take")
        await page.hears("notice", code="stale_fence")
        await page.hears("control", state="free")
    session = await eventually(ControlSession.objects.filter(ended_at__isnull=False).first)
    assert session.end_reason == EndReason.BRIDGE


async def test_release_without_control_is_refused(open_page):
    page = await open_page("operator")
    await page.say("release")
    await page.refused("no_lease")


async def test_the_next_in_line_is_offered_the_free_robot(open_page):
    holder, asker, third = await open_page("operator"), await open_page("second"), await open_page("operator")
    await holder.take()
    await asker.hears("control", state="other")
    await asker.say("ask")
    waiting = await asker.hears("control")
    assert (waiting["ahead"], waiting.get("offer_s")) == (0, None)
    await holder.say("release")
    offer = await asker.hears("control", state="free")
    assert 20.0 < offer["offer_s"] <= 30.0
    assert offer["refusal"] is None
    await asker.hears("notice", code="your_turn")
    await third.say("take")
    refusal = (await third.refused("next_in_line"))["refusal"]
    assert "Olaf Operator is next in line" in refusal["text"]
    await asker.take()


async def test_second_person_asks_and_gets_control(open_page, bridge):
    holder, asker = await open_page("operator"), await open_page("second")
    old = (await holder.take())["fence"]
    await asker.hears("control", state="other")
    await asker.say("ask")
    assert (await asker.hears("control"))["asking"]
    asked = await holder.hears("control", state="yours")
    assert [request["name"] for request in asked["requests"]] == ["Olaf Operator"]
    await holder.hears("notice", code="asked")

    await holder.say("hand_over", number=asked["requests"][0]["number"])
    given = await asker.hears("control", state="yours")
    assert given["fence"] > old
    await holder.hears("control", state="other")
    assert (
        await bridge.hears(wire.Grant, lambda grant: grant.fence == given["fence"])
    ).holder == "Olaf Operator"

    await holder.say("drive", **drive(old))
    await holder.refused("no_lease")
    await asker.say("drive", **drive(given["fence"]))
    assert (await bridge.hears(wire.Drive)).fence == given["fence"]


async def test_a_reload_keeps_the_place_in_line(open_page):
    holder, asker = await open_page("operator"), await open_page("second")
    await holder.take()
    await asker.say("ask")
    await holder.hears("notice", code="asked")
    await asker.close()
    assert (await holder.hears("control"))["requests"] == []
    again = await open_page("second")
    assert again.control["asking"] or (await again.hears("control"))["asking"]
    assert len((await holder.hears("control"))["requests"]) == 1
    await holder.say("release")
    while (await again.hears("control")).get("offer_s") is None:
        pass


async def test_closing_the_page_withdraws_its_request(open_page):
    holder, asker = await open_page("operator"), await open_page("second")
    await holder.take()
    await asker.say("ask")
    await holder.hears("notice", code="asked")
    await asker.close()
    assert (await holder.hears("control"))["requests"] == []


async def test_withdrawing_a_request_gives_no_notice(open_page, monkeypatch):
    holder, asker = await open_page("operator"), await open_page("second")
    await holder.take()
    await asker.say("ask")
    while not (await asker.hears("control"))["asking"]:
        pass
    looks, control_status, cancel = (
        threading.Semaphore(0),
        robot_hub.control_status,
        line.line_leave,
    )

    def looked(*args, **kwargs):
        looks.release()
        return control_status(*args, **kwargs)

    def cancelled_after_a_look(**kwargs):
        for _ in range(3):
            assert looks.acquire(timeout=5)
        cancel(**kwargs)

    monkeypatch.setattr(robot_hub, "STATUS_S", 0.02)
    monkeypatch.setattr(robot_hub, "FULL_EVERY", 1)
    monkeypatch.setattr(robot_hub, "control_status", looked)
    monkeypatch.setattr(line, "line_leave", cancelled_after_a_look)
    await asker.say("ask_cancel")
    while (await asker.hears("control"))["asking"]:
        pass
    await asker.hears_nothing("notice")
    assert not [message for message in asker.inbox if message["t"] == "notice"]


async def test_renewal_is_refused_while_another_person_asks(open_page):
    holder, asker = await open_page("operator"), await open_page("second")
    await holder.take()
    await asker.say("ask")
    await holder.hears("notice", code="asked")
    await holder.say("renew")
    await holder.refused("somebody_asks")


async def test_holder_learns_the_reason_of_a_takeover(open_page, bridge):
    holder, boss = await open_page("operator"), await open_page("supervisor")
    await holder.take()
    assert (await boss.hears("control", state="other"))["may_take_over"]
    await boss.say("take_over", reason="fire\u202edrill")
    await boss.refused("name_unseen")
    await boss.say("take_over", reason="fire drill")
    fence = (await boss.hears("control", state="yours"))["fence"]
    message = await holder.hears("notice", code="taken_over")
    assert "fire drill" in message["text"]
    assert message["level"] == "info"  # info: a person decided it, nothing failed
    await bridge.hears(wire.Grant, lambda grant: grant.fence == fence)


async def test_operator_cannot_take_over(open_page):
    holder, other = await open_page("operator"), await open_page("second")
    await holder.take()
    await other.say("take_over", reason="because I want it")
    await other.refused("role_too_low")


# --- the end of a term ----------------------------------------------------------------------------------


async def test_control_ends_with_its_term(open_page, bridge):
    page = await open_page("operator")
    fence = (await page.take())["fence"]
    await moves_on(term_ends_at=timezone.now())
    assert (await bridge.hears(wire.Revoke)).fence == fence
    assert (await page.hears("notice", code="term"))["level"] == "warning"
    await page.hears("control", state="free")
    assert await count("control.end") == 1


async def test_a_slot_booked_for_now_ends_control_after_a_warning(open_page, bridge, robot, operator):
    page = await open_page("supervisor")
    fence = (await page.take())["fence"]
    await in_database(_book_now, robot, operator)
    while not (control := await page.hears("control", state="yours"))["next_booked"]:
        pass  # the page counts down to the slot, as to every slot
    assert 290.0 < control["next_booked"]["seconds"] <= 300.0
    assert control["booked"] is None
    await in_database(_five_minutes_pass)
    begun_s = time.monotonic()
    assert (await bridge.hears(wire.Revoke)).fence == fence
    assert time.monotonic() - begun_s < 2.0  # at the next read of the database
    await page.hears("notice", code="slot")
    owner = await open_page("operator")
    assert (await owner.take())["fence"] == fence + 1
    await page.say("take_over", reason="because I want it")
    assert (await page.hears("control", state="yours"))["fence"] == fence + 2


async def test_the_holder_sees_an_out_of_service_period_come(open_page, bridge, robot):
    page = await open_page("operator")
    fence = (await page.take())["fence"]
    repair = {"robot": robot, "why": "repair"}
    begins = timezone.now() + timedelta(minutes=4)
    period = await in_database(partial(OutOfService.objects.create, starts_at=begins, **repair))
    while (control := await page.hears("control", state="yours"))["out_s"] is None:
        pass
    assert 230.0 < control["out_s"] <= 240.0
    assert control["remaining_s"] <= 240.0
    period.starts_at = timezone.now()
    await in_database(period.save)
    assert (await bridge.hears(wire.Revoke)).fence == fence
    assert "out of service" in (await page.hears("notice"))["text"]


async def test_a_slot_that_is_given_up_leaves_a_term_of_free_time(open_page, robot, operator, browsers):
    booking = await in_database(_book_now, robot, operator)
    page = await open_page("operator")
    assert (await page.take())["remaining_s"] > 3000.0  # until the end of the slot
    posted = {"action": "cancel", "version": booking.version}
    await in_database(browsers["operator"].post, f"/bookings/{booking.pk}/", posted)
    lasts_s = await eventually(_short_term)
    assert lasts_s <= 15 * 60.0


def _five_minutes_pass():
    for rows, name in ((Booking.objects, "made_at"), (ControlSession.objects, "started_at")):
        rows.update(**{name: F(name) - WARNING})


def _book_now(robot, person):
    now = timezone.now()
    slot = Slot(now, now + timedelta(hours=1))
    return booking_make(robot=robot, person=person, slot=slot, now=now)


def _short_term():
    """Return the seconds of control that are left; None while the slot of an hour still counts."""
    left_s = (Lease.objects.get().term_ends_at - timezone.now()).total_seconds()
    return left_s if left_s < 3000.0 else None


async def test_control_ends_with_its_term_even_if_not_recorded(open_page, bridge, monkeypatch):
    page = await open_page("operator")
    fence = (await page.take())["fence"]
    monkeypatch.setattr(audit, "record", unavailable)
    monkeypatch.setattr(robot_hub, "lease_store_seen", away)
    await moves_on(term_ends_at=timezone.now())
    assert (await bridge.hears(wire.Revoke)).fence == fence
    await page.hears("notice", code="term")
    await page.hears("control", state="free")
    assert (await open_page("observer")).control["state"] == "free"


async def test_renewal_starts_a_new_term(open_page):
    page = await open_page("operator")
    await page.take()
    await moves_on(term_ends_at=timezone.now() + timedelta(seconds=30))
    await page.hears("control")
    await page.say("renew")
    while (await page.hears("control"))["remaining_s"] < 890:
        pass  # told of the shorter term, before


async def test_renewal_is_answered_when_a_booking_allows_no_more(open_page, monkeypatch):
    page = await open_page("operator")
    ends = timezone.now() + timedelta(seconds=600)
    monkeypatch.setattr(services, "_term_end", lambda permit, now: ends)
    await page.take()
    await page.say("renew")
    assert (await page.hears("control"))["state"] == "yours"


# --- a lost page that returns ----------------------------------------------------------------------------


async def test_closed_page_pauses_the_bridge_and_others_see_it(open_page, bridge):
    page, watching = await open_page("operator"), await open_page("second")
    fence = (await page.take())["fence"]
    await watching.hears("control", state="other")
    await page.close()
    assert (await bridge.hears(wire.Pause, lambda pause: "gone" in pause.reason)).fence == fence
    away = await watching.hears("control", state="away")
    assert 8 < away["resumable_s"] <= 10


async def test_reloaded_page_resumes_with_the_same_fence(open_page, bridge):
    page = await open_page("operator")
    before = await page.take()
    await page.close()
    again = await open_page("operator")
    control = (
        await again.hears("control", state="yours") if again.control["state"] != "yours" else again.control
    )
    assert (control["fence"], control["session"]) == (before["fence"], before["session"])
    await again.say("drive", **drive(control["fence"], seq=0))
    await bridge.hears(wire.Drive)


async def test_page_has_lost_control_after_the_grace(open_page):
    page = await open_page("operator")
    await page.take()
    await page.close()
    await moves_on(seen_at=timezone.now() - timedelta(seconds=11))
    again = await open_page("operator")
    assert again.control["state"] == "free"
    session = await in_database(ControlSession.objects.get)
    assert session.end_reason == EndReason.AWAY


async def test_nobody_is_gone_because_the_database_was(open_page, robot, operator):
    await taken_elsewhere(robot, operator)
    await open_page("second")
    hub = robot_hub._hubs[robot.id]
    hub._database._answered_s -= GAP_S + 1.0
    await moves_on(seen_at=timezone.now() - timedelta(seconds=11))
    await hub.read_status()
    session = await in_database(ControlSession.objects.get)
    assert session.end_reason == ""
    hub._database = DatabaseWatch()
    await hub.read_status()
    await in_database(session.refresh_from_db)
    assert session.end_reason == EndReason.AWAY


async def test_another_tab_does_not_resume_but_may_take(open_page, bridge):
    first = await open_page("operator")
    old = (await first.take())["fence"]
    second = await open_page("operator", tab="another-tab-0123456789")
    assert second.control["state"] == "elsewhere"
    await second.say("take")
    assert (await second.hears("control", state="yours"))["fence"] > old
    await first.hears("notice", code="moved")
    await first.hears("control", state="elsewhere")


async def test_newest_of_duplicated_tabs_has_control(open_page, bridge):
    older = await open_page("operator")
    fence = (await older.take())["fence"]
    newest = await open_page("operator")
    if newest.control["state"] != "yours":
        await newest.hears("control", state="yours")
    await older.hears("notice", code="elsewhere")
    await older.hears("control", state="elsewhere")
    await older.say("drive", **drive(fence))
    await older.refused("no_lease")
    await newest.say("drive", **drive(fence))
    await bridge.hears(wire.Drive)
    assert not bridge.all(wire.Revoke)


async def test_new_sign_in_in_the_same_tab_does_not_resume(open_page, browsers, operator):
    page = await open_page("operator")
    await page.take()
    await page.close()
    await in_database(browsers["operator"].force_login, operator)  # a new sign-in session, the same tab token
    again = await open_page("operator")
    assert again.control["state"] == "away"


async def test_grant_is_renewed_when_the_link_comes_back(open_page, bridge):
    page = await open_page("operator")
    fence = (await page.take())["fence"]
    granted = len(bridge.all(wire.Grant))
    bridge.cut()
    await bridge.hears(wire.Grant, lambda grant: grant.fence == fence, count=granted + 1)
    await page.say("drive", **drive(fence))
    await bridge.hears(wire.Drive)


# --- several web processes --------------------------------------------------------------------------------


def taken_elsewhere(robot, person):
    """Let a person take control in another web process."""
    tab = Tab("their-tab-0123456789", "their-sign-in", "their-connection")
    return in_database(
        services.lease_take,
        robot_id=robot.id,
        user_id=person.id,
        tab=tab,
        highest_fence=0,
        now=timezone.now(),
    )


async def test_change_by_another_process_is_seen_at_the_next_read(open_page, robot, operator):
    page = await open_page("observer")
    await taken_elsewhere(robot, operator)
    assert (await page.hears("control", state="other"))["holder"] == "Olga Operator"


async def test_lease_event_of_another_process_is_seen_at_once(open_page, robot, operator, monkeypatch):
    page = await open_page("observer")
    monkeypatch.setattr("teleop.live.robot_hub.STATUS_S", 60)
    await page.hears_nothing("control", within_s=0.6)  # the next regular read is over
    await taken_elsewhere(robot, operator)
    elsewhere = LeaseEvents(robot.id, on_change=lambda: pytest.fail("its own event"))
    await elsewhere.publish()
    await page.hears("control", state="other")
    await elsewhere.close()


async def test_control_is_taken_while_the_link_is_being_made(open_page, bridge, monkeypatch):
    open_link = robots.link.client.open_link

    @asynccontextmanager
    async def slowly(address):
        await asyncio.sleep(4 * robot_hub.LINK_WAIT_S)
        async with open_link(address) as socket:
            yield socket

    monkeypatch.setattr(robots.link.client, "open_link", slowly)
    await (await open_page("operator")).take()


async def test_page_opened_without_bridge_is_informed(open_page, bridge):
    await bridge.close()
    page = await open_page("observer")
    assert (await page.hears("bridge_gone"))["refusal"]["code"] == "bridge_down"


async def test_robot_out_of_service_is_shown_as_such(open_page, bridge, robot):
    await in_database(lambda: Robot.objects.update(enabled=False))
    await bridge.close()
    page = await open_page("observer")
    assert (await page.hears("bridge_gone"))["refusal"]["code"] == "robot_disabled"


# --- an open connection whose page is gone -----------------------------------------------------------


@pytest.fixture
def short_grace(monkeypatch):
    """A page counts as lost after 0.6 s, and its lease ends after 1.2 s; the database is read often."""
    monkeypatch.setattr(lease_checks, "LOST_AFTER_S", 0.6)
    monkeypatch.setattr(lease_checks, "GRACE_S", 1.2)
    monkeypatch.setattr(robot_hub, "STATUS_S", 0.05)


async def test_holder_with_a_cut_network_loses_control(open_page, bridge, short_grace):
    holder, watching = await open_page("operator"), await open_page("second")
    await holder.say("take")
    await watching.hears("control", state="away")  # a busy computer may not report "other" before
    await watching.hears("control", state="free")
    await bridge.hears(wire.Revoke)


async def test_holder_that_only_pings_keeps_control(open_page, bridge, short_grace, monkeypatch):
    monkeypatch.setattr(lease_checks, "LOST_AFTER_S", 1.5)  # a busy computer may delay a ping by a second
    monkeypatch.setattr(lease_checks, "GRACE_S", 3.0)
    holder, watching = await open_page("operator"), await open_page("second")
    await holder.say("take")
    await watching.hears("control", state="other")
    until_s = time.monotonic() + 1.5 * lease_checks.LOST_AFTER_S
    while time.monotonic() < until_s:
        await holder.say("ping", sent_ms=1)
        await holder.hears("pong")
        await watching.hears_nothing("control", within_s=0.1)


async def test_page_closed_during_a_read_gets_no_control_again(open_page, bridge, monkeypatch):
    monkeypatch.setattr(robot_hub, "STATUS_S", 0.02)
    monkeypatch.setattr(robot_hub, "FULL_EVERY", 1)
    noted, looks, control_status = threading.Event(), threading.Semaphore(0), robot_hub.control_status

    def looked(*args, **kwargs):
        looks.release()
        return control_status(*args, **kwargs)

    monkeypatch.setattr(control_holder, "_leave", lambda *_args: noted.wait(10))  # the database is slow
    page = await open_page("operator")
    await open_page("second")
    await page.take()
    closing = asyncio.ensure_future(page.close())
    await bridge.hears(wire.Pause, lambda pause: pause.reason == "The page is gone.")
    granted = len(bridge.all(wire.Grant))
    monkeypatch.setattr(robot_hub, "control_status", looked)
    for _ in range(4):
        assert await asyncio.to_thread(looks.acquire, timeout=5)
    noted.set()
    await closing
    assert len(bridge.all(wire.Grant)) == granted
    assert bridge.all(wire.Pause)[-1].reason == "The page is gone."


async def test_database_fault_at_hello_closes_the_page(open_page, monkeypatch):
    page = await open_page("operator", hello=False)
    with monkeypatch.context() as broken:
        broken.setattr(robot_hub, "control_status", away)
        await page.say("hello", tab="operator-tab-0123456789")
        assert await page.is_closed() == CloseCode.TRY_AGAIN
    await open_page("operator")


async def test_resume_that_cannot_be_stored_closes_the_page(open_page, monkeypatch):
    page = await open_page("operator")
    session = (await page.take())["session"]
    await page.close()
    with monkeypatch.context() as full:
        full.setattr(audit, "record", unavailable)
        page = await open_page("operator", hello=False)
        await page.say("hello", tab="operator-tab-0123456789")
        assert await page.is_closed() == CloseCode.TRY_AGAIN
    again = await open_page("operator")
    control = (
        again.control if again.control["state"] == "yours" else await again.hears("control", state="yours")
    )
    assert control["session"] == session


async def test_stored_change_is_accepted_even_if_not_yet_shown(open_page, monkeypatch):
    page = await open_page("operator")
    with monkeypatch.context() as broken:
        broken.setattr(robot_hub, "control_status", away)
        await page.say("take")
        await eventually(ControlSession.objects.exists)
        await page.hears_nothing("refused")
    await page.hears("control", state="yours")


async def test_hub_closed_while_its_robot_is_edited_follows_no_link(open_page, bridge, monkeypatch):
    leaving, asked, closing, informed = (threading.Event() for _ in range(4))
    read, close, remove = robot_hub.robot_entry, LeaseEvents.close, robot_hub.RobotHub.remove

    def edited(robot_id):
        if not leaving.is_set():
            return read(robot_id)
        asked.set()
        closing.wait(0.5)
        entry = read(robot_id)
        return entry and structs.replace(entry, link=structs.replace(entry.link, unix_path="/nowhere"))

    async def removed_while_it_reads(hub, member):
        leaving.set()
        assert await asyncio.to_thread(asked.wait, 10)
        await remove(hub, member)

    async def closes(events):
        closing.set()
        await asyncio.to_thread(informed.wait, 0.5)
        await close(events)

    monkeypatch.setattr(robot_hub, "STATUS_S", 0.02)
    page = await open_page("observer")
    [hub] = robot_hub._hubs.values()
    monkeypatch.setattr(hub, "viewers_changed", informed.set)
    monkeypatch.setattr(robot_hub, "robot_entry", edited)
    monkeypatch.setattr(robot_hub.RobotHub, "remove", removed_while_it_reads)
    monkeypatch.setattr(LeaseEvents, "close", closes)
    await page.close()
    assert closing.is_set()
    assert hub not in hub.link._listeners


async def test_fault_of_one_page_does_not_affect_others(open_page, bridge, monkeypatch):
    await open_page("operator")
    second = await open_page("second")
    [hub] = robot_hub._hubs.values()
    first = next(iter(hub.members.values()))

    async def fails(_standing):
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(first, "follow", fails)
    await second.say("take")
    await second.hears("control", state="yours")
