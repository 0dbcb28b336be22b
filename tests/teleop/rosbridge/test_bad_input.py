"""Rubbish at the rosbridge door: each gets a status with a code, nothing grows, and the connection lives."""

import asyncio
import json

import pytest

from fleet.server import WRITABLE
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from teleop.live.consumers import message_socket
from teleop.live.consumers.message_socket import FLOOD_BURST, CloseCode
from teleop.rosbridge import consumer, publishing, reassembly
from teleop.rosbridge.operations import LARGEST_BYTES
from tests.teleop.rosbridge.support import Client

pytestmark = pytest.mark.django_db(transaction=True)

PUBLISH = '{"op":"publish","topic":"/cmd_vel","msg":'
TWIST = "geometry_msgs/Twist"


RUBBISH = [
    ("", "not_json"),
    ("go!", "not_json"),
    ("[]", "invalid"),
    ("\ud800", "not_json"),
    ('{"op":"fly"}', "invalid"),
    ('{"topic":"/cmd_vel"}', "invalid"),
    (f'{PUBLISH}{{"linear":{{"x":NaN}}}}}}', "not_json"),
    (f"{PUBLISH}{'[' * 5000}{']' * 5000}}}", "invalid"),
    (f'{PUBLISH}{{"a":{"[" * 5000}{"]" * 5000}}}}}', "not_json"),
    (f"{PUBLISH}7}}", "invalid"),
    (f'{PUBLISH}{{"linear":{{"x":1e999}}}}}}', "invalid"),
    (f'{PUBLISH}{{"a":{"[" * 30}{"]" * 30}}}}}', "invalid"),
    (f'{PUBLISH}{{"a":"{"x" * 9000}"}}}}', "too_large"),
    ('{"op":"call_service","service":"/rosapi/topics","id":"%s"}' % ("x" * 60_000), "invalid"),
    ('{"op":"publish","topic":"/a","msg":{"data":"%s"}}' % ("x" * LARGEST_BYTES), "too_large"),
    ('{"op":"advertise","topic":"/a","type":"no type"}', "invalid"),
    ('{"op":"advertise","topic":"/class/def","type":"no_such/Type"}', "not_allowed"),
    ('{"op":"png","data":"aGVsbG8="}', "invalid"),
    ('{"op":"call_service","service":"/a","args":{"a":%s}}' % ("[" * 900 + "]" * 900), "invalid"),
    ('{"op":"service_response","service":"/a","values":{"a":%s}}' % ("[" * 900 + "]" * 900), "invalid"),
    ('{"op":"auth","mac":"fleet_x"}', "signed_in"),
    ('{"op":"set_level","level":"loud"}', "invalid"),
    ('{"op":"subscribe","topic":"/a","throttle_rate":%s}' % ("9" * 400), "invalid"),
    ('{"op":"fragment","id":"f","num":-1,"total":2,"data":""}', "invalid"),
    ('{"op":"fragment","id":"f","num":0,"total":1000000000,"data":""}', "invalid"),
]


@pytest.fixture(autouse=True)
def all_replies(monkeypatch):
    """Each refusal is told, however many there are."""
    monkeypatch.setattr(message_socket, "REPLIES_BURST", 1000.0)


async def test_rubbish_is_told(driver, bridge):
    for raw, code in RUBBISH:
        await driver.say_raw(raw)
        status = await driver.hears_op("status")
        assert status["msg"].startswith(f"{code}: "), (raw[:80], status)
    await still_drives(driver, bridge)


async def still_drives(client, bridge):
    await client.send("publish", topic="/cmd_vel", msg={"linear": {"x": 0.3}})
    await bridge.hears(wire.LinkVelocity, lambda sent: sent.order.fields == {"linear": {"x": 0.3}})
    assert len(bridge.all(wire.LinkVelocity)) == 2  # and the zero when control was taken


async def test_a_binary_frame_is_told(driver):
    await driver.say_bytes(b"\x00\xff")
    await driver.told("not_text")


async def test_the_id_comes_back_with_the_status(driver):
    await driver.send("subscribe", topic="/a", throttle_rate=-1, id="mine")
    assert (await driver.told("invalid"))["id"] == "mine"


async def test_a_call_or_goal_that_is_not_valid_has_an_end(driver):
    await driver.send("call_service", service="/rosapi/topics", args="[ true ]", id="call:1")
    answer = await driver.hears_op("service_response", id="call:1", service="/rosapi/topics")
    assert (answer["result"], answer["values"][:9]) == (False, "invalid: ")
    await driver.send("call_service", service=5, id="call:2")
    assert not (await driver.hears_op("service_response", id="call:2"))["result"]
    await driver.send("send_action_goal", action="/play_motion", args="wave", id="goal:1")
    result = await driver.hears_op("action_result", id="goal:1", action="/play_motion")
    assert (result["result"], result["status"], result["values"][:9]) == (False, 6, "invalid: ")


async def test_levels_of_status(driver):
    await driver.send("set_level", level="error")
    await driver.send("unadvertise", topic="/a")
    await driver.send("subscribe", topic="/a", throttle_rate=-1)
    await driver.told("invalid")
    assert not driver.inbox
    await driver.send("set_level", level="none")
    await driver.send("subscribe", topic="/a", throttle_rate=-1)
    await driver.call("/fleet/renew_control")
    assert not driver.inbox


async def test_a_flood_is_told_and_closed(driver):
    for _ in range(int(2.5 * FLOOD_BURST)):
        await driver.say_raw("go!")
    await driver.told("flood")
    assert await driver.is_closed() == CloseCode.FLOOD


async def test_a_client_that_does_not_read_drives_and_stops(robot, make_token, bridge, monkeypatch):
    monkeypatch.setattr(consumer, "MOST_WAITING", 1)
    reads = asyncio.Event()
    reads.set()
    client = Client(robot.slug, token=await make_token("operator"))
    client._socket.scope["extensions"] = {WRITABLE: reads}
    await client.open()
    await client.take()
    reads.clear()
    await client.send("subscribe", topic="/a", throttle_rate=-1)
    await client.send("publish", topic="/cmd_vel", msg={"linear": {"x": 0.3}})
    await bridge.hears(wire.LinkVelocity, lambda sent: sent.order.fields == {"linear": {"x": 0.3}})
    stop = json.dumps({"op": "call_service", "service": "/fleet/stop"})
    await fragment(client, 0, 2, stop[:20])
    await fragment(client, 1, 2, stop[20:])
    assert (await client.hears_op("service_response"))["result"]
    await bridge.hears(wire.LinkStop)
    await client.send("unadvertise", topic="/a")
    await client.told("busy")
    assert not client.inbox
    reads.set()
    await client.told("invalid")
    await client.close()


async def test_what_others_say_to_a_client_that_does_not_read_does_not_grow(
    robot, make_token, open_client, bridge, allow, monkeypatch
):
    allow(Allowed("call", "/fleet/clients/count", "lab_msgs/CountAction", "", "operator"))
    monkeypatch.setattr(consumer, "MOST_UNREAD", 300)
    reads = asyncio.Event()
    reads.set()
    client = Client(robot.slug, token=await make_token("operator"))
    client._socket.scope["extensions"] = {WRITABLE: reads}
    await client.open()
    await client.send("subscribe", topic="/fleet/clients/count/feedback")
    await client.call("/fleet/renew_control")
    reads.clear()
    other = await open_client("second_operator")
    for text in ("a" * 100, "b" * 300):
        await other.send("publish", topic="/fleet/clients/count/feedback", msg={"feedback": text})
    await other.call("/fleet/renew_control")
    reads.set()
    await other.send("publish", topic="/fleet/clients/count/feedback", msg={"feedback": "c"})
    heard = [(await client.hears_op("publish"))["msg"]["feedback"] for _ in range(2)]
    assert heard == ["a" * 100, "c"]
    await client.close()


# --- fragments -------------------------------------------------------------------------------------------------


async def fragment(client, num, total, data, id="f"):
    await client.send("fragment", id=id, num=num, total=total, data=data)


async def test_fragments_become_an_operation_in_any_order(driver, bridge):
    text = json.dumps({"op": "publish", "topic": "/cmd_vel", "msg": {"linear": {"x": 0.25}}})
    for num in (2, 0, 1):
        await fragment(driver, num, 3, text[num * 30 : (num + 1) * 30 if num < 2 else None])
    await bridge.hears(wire.LinkVelocity, lambda sent: sent.order.fields == {"linear": {"x": 0.25}})


MISFITS = [
    ((0, 2, "b"), "bad_fragment"),
    ((1, 3, "b"), "bad_fragment"),
    ((2, 2, "b"), "bad_fragment"),
    ((1, 2, "x" * (LARGEST_BYTES - 100)), "too_large"),
    ((1, 2, "!"), "not_json"),
    ((1, 2, json.dumps({"op": "set_level", "level": "nine"})[1:]), "invalid"),
]


async def test_fragments_that_do_not_fit_are_told(driver):
    for second, code in MISFITS:
        await fragment(driver, 0, 2, "{" if code == "invalid" else "x" * 200)
        await fragment(driver, *second)
        status = await driver.hears_op("status")
        assert status["msg"].startswith(f"{code}: "), (second, status)
    # Nothing is left of them
    await fragment(driver, 0, 2, '{"op":"set_level",')
    await fragment(driver, 1, 2, '"level":"error"}')
    await driver.call("/fleet/renew_control")
    assert not [one for one in driver.inbox if one["op"] == "status"]


async def test_fragments_that_never_end_are_dropped(driver, monkeypatch):
    for number in range(reassembly.MOST_OPEN + 1):
        await fragment(driver, 0, 2, "x", id=str(number))
    await driver.told("too_many_fragments")
    monkeypatch.setattr(reassembly, "PATIENCE_S", 0.0)
    await fragment(driver, 0, 1, '{"op":"fragment","id":1,"num":0,"total":1,"data":""}', id="nested")
    await driver.told("bad_fragment")


# --- topics of two clients -----------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def allowed(allow):
    """The allow-list."""
    allow(
        Allowed("publish", "/leds", "std_msgs/String", "", "operator"),
        Allowed("publish", "/leds", "std_msgs/Int32", "", "operator"),
        Allowed("publish", "/horn", "std_msgs/Empty", "", "operator"),
        Allowed("publish", "/staff", "std_msgs/Empty", "", "staff"),
    )


FORBIDDEN = [
    ("/cmd_vel", "std_msgs/String", "other_type"),
    ("/horn", "std_msgs/String", "other_type"),
    ("/staff", "std_msgs/Empty", "role_too_low"),
    ("/nothing", "std_msgs/Empty", "not_allowed"),
]


async def test_topics_that_may_not_be_published(open_client):
    client = await open_client("operator")
    for topic, type_, code in FORBIDDEN:
        await client.send("advertise", topic=topic, type=type_)
        assert (await client.hears_op("status"))["msg"].startswith(f"{code}: "), topic


async def test_two_clients_with_different_types(driver, open_client):
    other = await open_client("second_operator")
    await driver.send("advertise", topic="/leds", type="std_msgs/String")
    await driver.call("/fleet/renew_control")
    await other.send("advertise", topic="/leds", type="std_msgs/Int32")
    await other.told("other_type")
    await driver.close()
    await other.send("advertise", topic="/leds", type="std_msgs/Int32")
    await other.send("unadvertise", topic="/leds")
    await other.send("unadvertise", topic="/leds")
    await other.told("not_advertised")


async def test_each_advertisement_of_a_topic_ends_by_itself(driver, open_client):
    other = await open_client("second_operator")
    for id_ in ("one", "two"):
        await driver.send("advertise", topic="/leds", type="std_msgs/String", id=id_)
    await driver.send("unadvertise", topic="/leds", id="one")
    await driver.call("/fleet/renew_control")
    await other.send("advertise", topic="/leds", type="std_msgs/Int32")
    await other.told("other_type")
    await driver.send("unadvertise", topic="/leds", id="two")
    await driver.call("/fleet/renew_control")
    await other.send("advertise", topic="/leds", type="std_msgs/Int32", id="three")
    await other.send("unadvertise", topic="/leds", id="three")
    await other.call("/fleet/renew_control")
    assert not [one for one in other.inbox if one["op"] == "status" and "no_lease" not in one["msg"]]


async def test_nobody_keeps_another_from_what_the_console_takes(driver, open_client):
    other = await open_client("observer")
    for topic in ("/play_motion/goal", "/cmd_vel"):
        await other.send("advertise", topic=topic, type=TWIST)
        await other.call("/fleet/renew_control")
        await driver.send("advertise", topic=topic, type=TWIST.replace("Twist", "TwistStamped"))
    told = (await driver.told("other_type"))["msg"]
    assert "/cmd_vel" in told and not [one for one in driver.inbox if one["op"] == "status"]


async def test_advertised_topics_are_limited(open_client, monkeypatch):
    monkeypatch.setattr(publishing, "MOST_TOPICS", 1)
    client = await open_client("operator")
    await client.send("advertise", topic="/leds", type="std_msgs/String")
    await client.send("advertise", topic="/horn", type="std_msgs/Empty")
    await client.told("too_many_topics")


async def test_a_message_of_the_allow_list_is_published(driver, bridge):
    await driver.send("publish", topic="horn", msg={})
    sent = await bridge.hears(wire.Publish, lambda sent: sent.topic == "/horn")
    assert (sent.type, sent.fence) == ("std_msgs/Empty", 1)
    bridge.refuses_tasks = wire.Refusal("unknown_topic", "No node reads it.", "robot")
    await driver.send("publish", topic="/horn", msg={}, id="again")
    assert (await driver.told("unknown_topic"))["id"] == "again"
