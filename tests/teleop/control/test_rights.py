"""Rights are checked regularly: a person who loses the right to drive loses control within a second."""

import asyncio
import time
from datetime import date, timedelta

import pytest
from django.db import OperationalError
from django.utils import timezone

from fleet.audit.models import Record
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant, RobotGroup
from robots.registry.models import Robot, RobotRole
from robots.shared import wire
from teleop.background.database import in_database
from teleop.live import grant_renewal, robot_hub
from teleop.live.consumers.message_socket import CloseCode
from teleop.live.robot_hub import STATUS_S
from teleop.models import ControlSession, EndReason
from tests.teleop.support import eventually

pytestmark = pytest.mark.django_db(transaction=True)

LONGEST_S = 3.0  # the console checks twice a second; a busy computer needs longer


async def revoked_in_time(bridge, take_away):
    """Take the right away; check that control is revoked at the bridge within `LONGEST_S`."""
    begun_s = time.monotonic()
    await in_database(take_away)
    await bridge.hears(wire.Revoke)
    assert time.monotonic() - begun_s < LONGEST_S
    session = await in_database(ControlSession.objects.get)
    assert session.ended_at is None or session.end_reason == EndReason.RIGHT


async def test_losing_the_role_ends_control_but_not_watching(holder, bridge, operator):
    await revoked_in_time(bridge, lambda: RobotRole.objects.filter(user=operator).update(role="observer"))
    await holder.hears("welcome", role="observer")
    await holder.hears("notice", code="role_too_low")
    message = await holder.hears("control", state="free")
    assert message["refusal"]["code"] == "role_too_low"
    assert "yours" not in [message.get("state") for message in holder.inbox]
    ended = await eventually(Record.objects.filter(kind="control.end").first)
    assert ended.parameters["why"] == "role_too_low"


async def test_losing_every_role_closes_the_page(holder, bridge, operator):
    await revoked_in_time(bridge, lambda: RobotRole.objects.filter(user=operator).delete())
    assert await holder.is_closed() == CloseCode.NOT_PERMITTED


@pytest.mark.parametrize("change", [{"archived": True}, {"ends_on": date(2020, 1, 2)}, {"role": "observer"}])
async def test_end_of_a_course_ends_control(change, open_page, bridge, robot, stranger):
    def enrol():
        course = Course.objects.create(
            name="HRI", slug="hri", starts_on=date(2020, 1, 1), ends_on=date(2999, 1, 1)
        )
        group = RobotGroup.objects.create(name="TIAGos", slug="tiagos")
        group.robots.add(robot)
        course.groups.add(group)
        Enrolment.objects.create(course=course, person=stranger)

    await in_database(enrol)
    page = await open_page("stranger")
    await page.take()
    await revoked_in_time(bridge, lambda: Course.objects.update(**change))


async def test_end_of_an_enrolment_ends_control(open_page, bridge, robot, stranger):
    def enrol():
        course = Course.objects.create(
            name="HRI", slug="hri", starts_on=date(2020, 1, 1), ends_on=date(2999, 1, 1)
        )
        course.robots.add(robot)
        Enrolment.objects.create(course=course, person=stranger)

    await in_database(enrol)
    page = await open_page("stranger")
    await page.take()
    await revoked_in_time(bridge, lambda: Enrolment.objects.all().delete())
    assert await page.is_closed() == CloseCode.NOT_PERMITTED


async def test_control_ends_with_a_qualification(open_page, bridge, robot, operator):
    def demand():
        induction = Qualification.objects.create(
            name="safety induction", slug="induction", description="Every Monday at 9, room 12."
        )
        induction.robots.add(robot)
        return induction

    def grant(induction):
        QualificationGrant.objects.create(qualification=induction, person=operator)

    induction = await in_database(demand)
    page = await open_page("operator")
    refusal = page.control["refusal"]
    assert refusal["code"] == "unqualified"
    assert "safety induction" in refusal["text"]
    assert "Every Monday" in refusal["text"]
    await page.say("take")
    await page.refused("unqualified")
    await in_database(grant, induction)
    await page.hears("control", refusal=None)
    await page.take()
    past = timezone.now() - timedelta(seconds=1)
    await revoked_in_time(bridge, lambda: QualificationGrant.objects.update(expires_at=past))
    await page.hears("notice", code="unqualified")


async def test_signing_out_elsewhere_ends_control(holder, bridge, browsers, end_session):
    await revoked_in_time(bridge, lambda: end_session(browsers["operator"]))
    assert await holder.is_closed() == CloseCode.SIGNED_OUT


async def test_signing_out_frees_the_robot_of_a_closed_page(holder, browsers, operator):
    await holder.close()
    await eventually(ControlSession.objects.filter(lease__connection="").first)  # its page may come back
    await in_database(lambda: browsers["operator"].post("/accounts/sign-out/"))
    session = await in_database(ControlSession.objects.get)
    assert session.end_reason == EndReason.RIGHT
    ended = await in_database(lambda: Record.objects.get(kind="control.end"))
    assert (ended.actor_id, ended.parameters["why"]) == (str(operator.pk), "signed_out")


async def test_closed_account_loses_control(holder, bridge, operator):
    def close():
        operator.is_active = False
        operator.save()

    await revoked_in_time(bridge, close)
    assert await holder.is_closed() == CloseCode.SIGNED_OUT


async def test_changed_password_ends_control(holder, bridge, operator):
    def change():
        operator.set_password("another walk on the beach")
        operator.save()

    await revoked_in_time(bridge, change)


async def test_lower_role_ends_control_and_its_tasks(open_page, bridge, supervisor):
    page = await open_page("supervisor")
    await page.say("take")
    await page.hears("control", state="yours")
    await revoked_in_time(bridge, lambda: RobotRole.objects.filter(user=supervisor).update(role="operator"))
    await page.hears("notice", code="role_lowered")
    message = await page.hears("control", state="free")
    assert message["refusal"] is None


def set_role(role):
    return in_database(lambda: RobotRole.objects.filter(user__username="supervisor").update(role=role))


async def test_page_that_returns_with_a_lower_role_has_no_control(open_page, bridge):
    page = await open_page("supervisor")
    await page.say("take")
    fence = (await page.hears("control", state="yours"))["fence"]
    await page.close()
    await set_role("operator")
    again = await open_page("supervisor")
    await again.hears("notice", code="role_lowered")
    assert "yours" not in [message.get("state") for message in [again.control, *again.inbox]]
    assert (await bridge.hears(wire.Revoke)).fence == fence
    ended = await eventually(Record.objects.filter(kind="control.end").first)
    assert (ended.outcome, ended.parameters["why"]) == (EndReason.RIGHT, "role_lowered")


async def test_role_that_rises_and_falls_back_ends_nothing(open_page, bridge, supervisor):
    await set_role("operator")
    page = await open_page("supervisor")
    await page.say("take")
    await page.hears("control", state="yours")
    for role in ("supervisor", "operator"):
        await set_role(role)
        await page.hears("welcome", role=role)
    await page.hears_nothing("notice")
    assert not bridge.all(wire.Revoke)


async def test_disabling_the_robot_ends_control_with_that_reason(holder, bridge):
    await revoked_in_time(bridge, lambda: Robot.objects.update(enabled=False))
    await holder.hears("notice", code="robot_disabled")


async def test_lower_speed_limit_reaches_the_bridge_while_driving(holder, bridge):
    await in_database(lambda: Robot.objects.update(max_share=0.3))
    await bridge.hears(wire.Grant, lambda grant: grant.max_share == 0.3)


async def test_observer_who_loses_the_role_is_disconnected(open_page, observer):
    page = await open_page("observer")
    await in_database(lambda: RobotRole.objects.filter(user=observer).delete())
    assert await page.is_closed() == CloseCode.NOT_PERMITTED


async def test_observer_who_signs_out_is_disconnected(open_page, browsers, end_session):
    page = await open_page("observer")
    await in_database(end_session, browsers["observer"])
    assert await page.is_closed() == CloseCode.SIGNED_OUT


async def test_stranger_does_not_learn_that_the_robot_exists(open_page):
    for slug in ("tiago-1", "no-such-robot"):
        page = await open_page("stranger", slug=slug, hello=False)
        assert await page.is_closed() == CloseCode.NOT_FOUND


async def test_edited_robot_is_shown_again(open_page, robot):
    page = await open_page("observer")
    await in_database(lambda: Robot.objects.update(name="Rosie"))
    assert (await page.hears("welcome"))["robot"]["name"] == "Rosie"


def away(*_args, **_kwargs):
    raise OperationalError("the database is away")


async def is_not_renewed(bridge):
    """Check that grants stop soon."""
    await asyncio.sleep(STATUS_S + grant_renewal.CONFIRMED_S)  # the last confirmation is valid that long
    granted = len(bridge.all(wire.Grant))
    with pytest.raises(asyncio.TimeoutError):
        await asyncio.wait_for(bridge.hears(wire.Grant, count=granted + 1), 1.5 * grant_renewal.RENEW_S)


async def test_unconfirmed_control_is_not_renewed(holder, bridge, monkeypatch):
    """The database fails: the bridge's own clock ends control three seconds later."""
    monkeypatch.setattr(grant_renewal, "CONFIRMED_S", 0.6)
    monkeypatch.setattr(robot_hub, "control_status", away)
    monkeypatch.setattr(robot_hub, "robot_entry", away)
    await is_not_renewed(bridge)


async def test_lasting_fault_of_renewal_is_logged_once(holder, bridge, monkeypatch, caplog):
    monkeypatch.setattr(grant_renewal, "RENEW_S", 0.02)
    tries = asyncio.Semaphore(0)
    grant = grant_renewal.GrantRenewer._grant

    async def fails(_grip):
        tries.release()
        raise RuntimeError("a fault of ours")

    async def tried(times):
        for _ in range(times):
            await asyncio.wait_for(tries.acquire(), 5.0)

    for logged in (1, 2):
        monkeypatch.setattr(grant_renewal.GrantRenewer, "_grant", fails)
        await tried(4)
        assert caplog.text.count("was not renewed") == logged
        monkeypatch.setattr(grant_renewal.GrantRenewer, "_grant", grant)
        await bridge.hears(wire.Grant, count=len(bridge.all(wire.Grant)) + 1)


async def test_read_of_others_rights_confirms_no_control(holder, open_page, bridge, monkeypatch):
    """The hub reads each newcomer's rights; this read does not confirm the holder's rights."""
    monkeypatch.setattr(grant_renewal, "CONFIRMED_S", 0.6)
    [hub] = robot_hub._hubs.values()
    holder = next(iter(hub.members.values()))
    read = robot_hub.control_status

    def knows_the_others(robot_id, *, people, **asked):
        return away() if holder.person in people else read(robot_id, people=people, **asked)

    monkeypatch.setattr(robot_hub, "control_status", knows_the_others)

    enough = asyncio.Event()

    async def come_and_go():
        while not enough.is_set():
            await (await open_page("observer")).close()

    coming = asyncio.ensure_future(come_and_go())
    try:
        await is_not_renewed(bridge)
    finally:
        enough.set()  # a test communicator ignores that its task is cancelled
        await coming
