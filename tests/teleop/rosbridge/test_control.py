"""The rosbridge door: sign-in, control by calls of services, velocities, stop."""

import asyncio
import threading
from functools import partial

import pytest
from django.db import DatabaseError
from django.test import Client as Browser
from django.utils import timezone

from fleet.accounts.tokens.models import Scope, Ticket, Token
from fleet.accounts.tokens.tickets import ticket_make
from fleet.audit.models import Record
from fleet.server import WRITABLE
from robots.shared import wire
from teleop.background.database import in_database
from teleop.control import services
from teleop.live.consumers.message_socket import CloseCode
from teleop.live.robot_hub import RobotHub
from teleop.models import ControlSession
from teleop.rosbridge import consumer, control_services
from teleop.rosbridge.subscribing import Subscribing
from tests.teleop.rosbridge.support import Client
from tests.teleop.support import Page, eventually

pytestmark = pytest.mark.django_db(transaction=True)

AHEAD = {"linear": {"x": 0.2, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.1}}


# --- sign-in ------------------------------------------------------------------------------------------------


async def test_a_cookie_does_not_sign_in(robot, browsers, websocket_headers, bridge):
    headers = {name.decode(): value.decode() for name, value in websocket_headers(browsers["operator"])}
    client = Client(robot.slug, **headers)
    await client.open()
    await client.send("advertise", topic="/cmd_vel", type="geometry_msgs/Twist")
    await client.told("sign_in_first")
    await client.close()


async def test_a_door_by_another_spelling_takes_no_cookie(robot, browsers, websocket_headers, bridge):
    page = Page(websocket_headers(browsers["operator"]), "/rosbridge/")
    page._socket.scope["path"] = f"//rosbridge/{robot.slug}"
    await page.open()
    await page.say_raw('{"op":"call_service","service":"/fleet/take_control"}')
    assert (await page._message())["msg"].startswith("sign_in_first: ")
    await page.close()


async def test_auth_signs_in(open_client, make_token):
    client = await open_client(None)
    await client.send(
        "auth", mac=await make_token("operator"), client="", dest="", rand="", t=0, level="", end=0
    )
    await client.take()


async def test_a_wrong_token_is_told_and_closed(open_client, robot, bridge):
    client = await open_client(None)
    await client.send("auth", mac="fleet_wrong")
    await client.told("token_invalid")
    assert await client.is_closed() == CloseCode.SIGNED_OUT
    client = await Client(robot.slug, token="fleet_wrong").open()
    await client.told("token_invalid")
    assert await client.is_closed() == CloseCode.SIGNED_OUT


async def test_a_ticket_works_once_within_its_minute(open_client, make_token, robot, bridge):
    async def made(ask):
        asked = f"/api/v1/robots/{robot.slug}/tickets"
        answer = await in_database(lambda: ask.post(asked, {"door": "rosbridge"}, "application/json"))
        assert answer.status_code == 201, answer.content
        return answer.json()["path"].removeprefix(f"/rosbridge/{robot.slug}")

    program = Browser(headers={"Authorization": f"Bearer {await make_token('operator')}"})
    query = await made(program)
    client = await Client(robot.slug, query=query).open()
    await client.take()
    again = await Client(robot.slug, query=query).open()
    await again.told("ticket_invalid")
    assert await again.is_closed() == CloseCode.SIGNED_OUT
    late = await made(program)
    await in_database(lambda: Ticket.objects.update(expires_at=timezone.now()))
    await (await Client(robot.slug, query=late).open()).told("ticket_expired")
    await client.close()


async def test_a_persons_ticket_ends_with_the_sign_in(robot, browsers, end_session, bridge):
    browser = await in_database(lambda: browsers["operator"])
    asked = f"/api/v1/robots/{robot.slug}/tickets"
    answer = await in_database(lambda: browser.post(asked, {"door": "rosbridge"}, "application/json"))
    client = await Client(robot.slug, query=f"?ticket={answer.json()['ticket']}").open()
    await client.take()
    await in_database(end_session, browser)
    assert await client.is_closed() == CloseCode.SIGNED_OUT


async def test_a_ticket_of_another_door_is_refused(robot, operator, bridge):
    make = partial(ticket_make, user=operator, sign_in="x", token=None, robot=robot.slug, door="foxglove")
    text, _ = await in_database(make)
    await (await Client(robot.slug, query=f"?ticket={text}").open()).told("ticket_elsewhere")


async def test_a_stranger_is_closed_in_time(open_client, monkeypatch):
    monkeypatch.setattr(consumer, "SIGN_IN_S", 0.05)
    client = await open_client(None)
    await client.told("sign_in_first")
    assert await client.is_closed() == CloseCode.SIGNED_OUT


async def test_of_many_strangers_the_one_that_waited_longest_is_closed(open_client, make_token, monkeypatch):
    monkeypatch.setattr(consumer, "MOST_UNKNOWN", 1)
    first = await open_client(None)
    second = await open_client(None)
    assert await first.is_closed() == CloseCode.SIGNED_OUT
    await second.send("auth", mac=await make_token("operator"))
    await second.take()
    await open_client(None)
    await second.call("/fleet/renew_control")


async def test_a_robot_that_the_person_does_not_see_is_not_found(open_client, other_robot):
    assert await (await open_client("operator", other_robot.slug)).is_closed() == CloseCode.NOT_FOUND


async def test_a_token_that_ends_ends_control(driver, bridge):
    fence = (await bridge.hears(wire.Grant)).fence
    await in_database(Token.objects.all().delete)
    assert await driver.is_closed() == CloseCode.SIGNED_OUT
    await bridge.hears(wire.Revoke, lambda revoke: revoke.fence == fence)


# --- control ---------------------------------------------------------------------------------------------------


async def test_publishing_takes_no_control(open_client, bridge):
    client = await open_client("operator")
    await client.send("publish", topic="/cmd_vel", msg=AHEAD, id="publish:/cmd_vel:1")
    assert (await client.told("no_lease"))["id"] == "publish:/cmd_vel:1"
    assert not bridge.all(wire.LinkVelocity)
    refused = await eventually(Record.objects.filter(kind="refusal").first)
    assert (refused.outcome, refused.parameters["through"]) == ("no_lease", "rosbridge")


async def test_a_velocity_reaches_the_drive_topic(driver, bridge, robot):
    await bridge.hears(
        wire.LinkVelocity, lambda sent: sent.order.fields == {}
    )  # so the first velocity drives
    await driver.send("advertise", topic="/cmd_vel", type="geometry_msgs/Twist")
    await driver.send("publish", topic="/cmd_vel", msg=AHEAD)
    sent = (await bridge.hears(wire.LinkVelocity, lambda sent: sent.order.fields == AHEAD)).order
    assert (sent.topic, sent.type, sent.fence) == ("/key_vel", "geometry_msgs/Twist", 1)
    assert sent.sent_ms is not None


async def test_the_bridges_refusal_of_a_velocity_is_told(driver, bridge):
    bridge.refuses_tasks = wire.Refusal("neutral_needed", "Publish a velocity of zero first.", "dead-man")
    await driver.send("publish", topic="cmd_vel", msg=AHEAD)
    await driver.told("neutral_needed")


async def test_a_second_client_does_not_get_control_and_asks(driver, open_client, bridge):
    other = await open_client("second_operator")
    answer = await other.call("/fleet/take_control")
    assert not answer["result"]
    assert answer["values"].startswith("held: ")
    assert (await other.call("/fleet/ask_control"))["values"]["ahead"] == 0
    assert (await driver.call("/fleet/release_control"))["values"]["state"] == "free"
    await other.take()


async def test_a_take_that_is_refused_for_its_time_gives_no_control_later(open_client, bridge, monkeypatch):
    monkeypatch.setattr(control_services, "ANSWER_S", 0.05)
    client = await open_client("operator")
    await client.call("/fleet/renew_control")  # its answer comes when the connection is complete
    with monkeypatch.context() as locked:

        async def fails(*_args, **_options):
            raise DatabaseError("locked")

        locked.setattr(RobotHub, "_read_status", fails)
        assert (await client.call("/fleet/take_control"))["values"].startswith("bridge_silent: ")
    await eventually(ControlSession.objects.filter(ended_at__isnull=False, end_reason="bridge").first)
    monkeypatch.setattr(control_services, "ANSWER_S", 10.0)
    await (await open_client("second_operator")).take()
    assert (await client.call("/fleet/renew_control"))["values"].startswith("not_holder: ")
    assert {grant.fence for grant in bridge.all(wire.Grant)} == {2}


async def test_control_ends_with_the_connection(driver, open_client, bridge):
    fence = (await bridge.hears(wire.Grant)).fence
    await driver.close()
    await bridge.hears(wire.Revoke, lambda revoke: revoke.fence == fence)
    await eventually(ControlSession.objects.filter(ended_at__isnull=False, end_reason="released").first)
    await (await open_client("second_operator")).take()


async def test_a_take_that_comes_after_the_connection_gives_no_control(open_client, bridge, monkeypatch):
    taken, closed, take = threading.Event(), threading.Event(), services.lease_take

    def late(**given):
        taken.set()
        assert closed.wait(10.0)
        return take(**given)

    client = await open_client("operator")
    with monkeypatch.context() as slow:
        slow.setattr(services, "lease_take", late)
        await client.send("call_service", service="/fleet/take_control")
        await asyncio.to_thread(taken.wait, 10.0)
        await client.close()
        closed.set()
    await eventually(ControlSession.objects.filter(ended_at__isnull=False, end_reason="released").first)
    await (await open_client("second_operator")).take()
    assert {grant.fence for grant in bridge.all(wire.Grant)} == {2}


async def test_control_ends_even_if_something_else_does_not(robot, make_token, bridge, monkeypatch):
    def fails(_self):
        raise OSError

    monkeypatch.setattr(Subscribing, "leave", fails)
    client = await Client(robot.slug, token=await make_token("operator")).open()
    await client.take()
    with pytest.raises(OSError):
        await client.close()
    await bridge.hears(wire.Revoke)


async def test_control_that_is_taken_away_is_told(driver, bridge, open_page):
    page = await open_page("staff")
    await page.say("take_over", reason="inspection")
    await page.hears("control", state="yours")
    await driver.send("set_level", level="info")
    await driver.send("publish", topic="/cmd_vel", msg=AHEAD)
    await driver.told("no_lease")


async def test_renewal_needs_control(open_client, bridge):
    client = await open_client("operator")
    assert (await client.call("/fleet/renew_control"))["values"].startswith("no_lease: ")
    await client.take()
    assert (await client.call("/fleet/renew_control"))["values"]["state"] == "yours"


async def test_driving_needs_the_scope(open_client, bridge):
    client = await open_client("operator", scopes=(Scope.TOPICS,))
    await client.take()
    await client.send("publish", topic="/cmd_vel", msg=AHEAD)
    await client.told("scope_missing")


async def test_anybody_who_sees_the_robot_stops_it(open_client, bridge):
    client = await open_client("observer", scopes=(Scope.TOPICS,))
    await client.send("call_service", service="/fleet/stop", args=["now"], id="stop")
    assert (await client.hears_op("service_response", id="stop"))["result"]
    assert (await bridge.hears(wire.LinkStop)).by


async def test_a_stop_that_is_not_confirmed_fails_with_the_reason(open_client, bridge, monkeypatch):
    monkeypatch.setattr("robots.link.client.STOP_S", 0.05)
    client = await open_client("observer")
    await bridge.close()
    answer = await client.call("/fleet/stop")
    assert (answer["result"], answer["values"][:9]) == (False, "pending: ")
    statuses = [one["msg"] for one in client.inbox if one["op"] == "status"]
    assert len([text for text in statuses if text.startswith("pending: ")]) == 1


@pytest.mark.parametrize("field", ["args", "timeout", "compression", "fragment_size", "id"])
async def test_a_stop_that_is_not_valid_is_refused_but_stops(open_client, bridge, field):
    client = await open_client("observer", scopes=(Scope.TOPICS,))
    await client.send("call_service", **({"service": "fleet/stop", "id": 5} | {field: True}))
    await bridge.hears(wire.LinkStop)
    await client.told("invalid")


async def test_a_stop_does_not_wait_for_the_link_of_a_new_connection(open_client, bridge, monkeypatch):
    tried = asyncio.Event()
    monkeypatch.setattr("teleop.live.robot_hub.RobotHub.wait_for_link", lambda _hub: tried.wait())
    client = await open_client("operator")
    await client.send("subscribe", topic="/a", throttle_rate=-1)
    assert (await client.call("/fleet/stop"))["result"]
    await bridge.hears(wire.LinkStop)
    assert not client.inbox
    tried.set()
    await client.told("invalid")


async def test_a_stop_is_sent_above_the_limit_of_operations(driver, bridge, monkeypatch):
    monkeypatch.setattr("teleop.live.consumers.message_socket.TokenBucket.spend", lambda *_: False)
    await driver.send("call_service", service="/fleet/stop")
    await asyncio.wait_for(bridge.hears(wire.LinkStop), 5.0)


async def test_a_flood_of_stops_is_not_answered_to_who_does_not_read(robot, make_token, bridge, monkeypatch):
    client = Client(robot.slug, token=await make_token("operator"))
    reads = client._socket.scope["extensions"] = {WRITABLE: asyncio.Event()}
    reads[WRITABLE].set()
    await client.open()
    await client.call("/fleet/renew_control")
    with monkeypatch.context() as flooded:
        flooded.setattr(consumer.RosbridgeConsumer, "spend", lambda _: False)
        reads[WRITABLE].clear()
        await client.send("call_service", service="/fleet/stop")
        await bridge.hears(wire.LinkStop)
    reads[WRITABLE].set()
    await client.call("/fleet/renew_control")
    assert not [one for one in client.inbox if one.get("service") == "/fleet/stop"]
    await client.close()
