"""Subscriptions: forms, fragments, rates, refusals; nothing of a topic is parsed in the web process."""

import asyncio
import base64
import io
import json

import cbor2
import pytest
from PIL import Image

from fleet.accounts.tokens.models import Scope
from fleet.audit.models import Record
from robots.bridge.tap.arrivals import Kind
from robots.shared.configuration.bridge_config import Allowed
from tests.teleop.support import eventually
from tests.teleop.tap.support import FakeTap

pytestmark = pytest.mark.django_db(transaction=True)

TOPIC = "/words"
LONG = {"data": "ä" * 3000}


@pytest.fixture
async def tap(robot, bridge):
    """The tap of the robot; it listens when a reader comes."""
    made = FakeTap(robot)
    yield made
    await made.close()


@pytest.fixture
async def subscribe(open_client, tap, bridge):
    """`await subscribe(...)`: the operator's client with this subscription, which the tap has heard."""
    clients = []

    async def begin(client=None, topic=TOPIC, **options):
        if client is None:
            client = await open_client("operator")
        await client.send("subscribe", topic=topic, id=options.pop("id", f"subscribe:{topic}:1"), **options)
        if not clients:
            await tap.start(bridge)
        clients.append(client)
        name = topic if topic.startswith("/") else f"/{topic}"
        await tap.until(lambda wanted: name in wanted)
        return client

    return begin


async def test_a_message_comes_as_rosbridge_writes_it(subscribe, tap):
    client = await subscribe(topic="words", type="std_msgs/String")
    tap.describe(TOPIC)
    tap.publish(TOPIC, {"data": "hello"})
    assert (await client.hears_op("publish"))["msg"] == {"data": "hello"}
    assert json.loads(client.last_raw)["topic"] == "words"  # clients look for the name that they gave


async def test_a_form_for_each_compression(subscribe, tap):
    await subscribe(client := await subscribe(compression="cbor"), id="raw", compression="cbor-raw")
    tap.describe(TOPIC)
    frame = await _binary(client, tap)
    assert (frame["op"], frame["topic"]) == ("publish", TOPIC)
    while "bytes" not in frame["msg"]:  # the tap has not heard the second subscription
        frame = await _binary(client, tap)
    assert json.loads(frame["msg"]["bytes"]) == {"data": 1}
    assert frame["msg"]["secs"] > 1e9
    await client.send("unsubscribe", topic=TOPIC, id="raw")
    while (frame := await _binary(client, tap))["msg"] != {"data": 1}:
        assert "bytes" in frame["msg"]


async def test_another_form_takes_the_place_of_the_one_before(subscribe, tap, monkeypatch):
    monkeypatch.setattr("teleop.tap.feed.MOST_READINGS", 1)
    await subscribe(client := await subscribe(), id="cbor", compression="cbor")
    tap.describe(TOPIC)
    assert (await _binary(client, tap))["msg"] == {"data": 1}
    assert not [one for one in client.inbox if one.get("op") == "status"]


async def _binary(client, tap):
    """Let messages arrive until the client gets one; return it."""
    while client._socket.output_queue.empty():
        tap.publish(TOPIC, {"data": 1})  # the tap may not know yet which form is wanted
        await asyncio.sleep(0.05)
    event = await client._event()
    return cbor2.loads(event["bytes"]) if event.get("bytes") else await _binary(client, tap)


async def test_a_picture_in_fragments_holds_the_operation(subscribe, tap):
    client = await subscribe(compression="png", fragment_size=50)
    tap.describe(TOPIC)
    tap.publish(TOPIC, LONG)
    parts = [await client.hears_op("fragment")]
    while len(parts) < parts[0]["total"]:
        parts.append(await client.hears_op("fragment"))
    assert [part["num"] for part in parts] == list(range(len(parts)))
    png = json.loads("".join(part["data"] for part in parts))
    assert png["op"] == "png"
    pixels = Image.open(io.BytesIO(base64.b64decode(png["data"]))).tobytes()
    assert json.loads(pixels) == {"op": "publish", "topic": TOPIC, "msg": LONG}


async def test_a_tiny_fragment_size_makes_few_fragments(subscribe, tap):
    client = await subscribe(fragment_size=1)
    tap.describe(TOPIC)
    tap.publish(TOPIC, LONG)
    assert (await client.hears_op("fragment"))["total"] <= 1000


async def test_the_newest_wins_at_the_rate_that_the_client_asked_for(subscribe, tap):
    client = await subscribe(throttle_rate=200)
    tap.describe(TOPIC)
    tap.publish(TOPIC, {"data": 0})
    await client.hears_op("publish")
    for number in range(1, 6):
        tap.publish(TOPIC, {"data": number})
        await asyncio.sleep(0.01)
    assert (await client.hears_op("publish"))["msg"]["data"] == 5


@pytest.mark.parametrize("expected", ["std_msgs/String", "std_msgs/msg/String"])
@pytest.mark.parametrize("published", ["std_msgs/String", "std_msgs/msg/String"])
async def test_types_have_two_spellings(subscribe, tap, expected: str, published: str):
    client = await subscribe(type=expected)
    tap.describe(TOPIC, Kind(published, ""))
    tap.publish(TOPIC, {"data": "hello"})
    assert (await client.hears_op("publish"))["msg"] == {"data": "hello"}


async def test_another_type_than_expected_is_told(subscribe, tap):
    client = await subscribe(type="std_msgs/Int32")
    tap.describe(TOPIC)
    await client.told("other_type")
    await tap.until(lambda wanted: TOPIC not in wanted)


async def test_only_the_subscription_of_the_wrong_type_ends(subscribe, tap):
    client = await subscribe(id=None, type="std_msgs/String")
    await client.send("subscribe", topic=TOPIC, id="other")
    await client.send("subscribe", topic=TOPIC, type="std_msgs/Int32")
    await client.send("subscribe", topic="/last")
    await tap.until(lambda wanted: "/last" in wanted)
    tap.describe(TOPIC)
    await client.told("other_type")
    tap.publish(TOPIC, {"data": "hello"})
    assert (await client.hears_op("publish"))["msg"] == {"data": "hello"}
    await client.send("unsubscribe", topic=TOPIC, id="other")
    await client.send("subscribe", topic="/more")
    await tap.until(lambda wanted: "/more" in wanted)
    tap.publish(TOPIC, {"data": "again"})
    assert (await client.hears_op("publish"))["msg"] == {"data": "again"}
    assert not [one for one in client.inbox if one["op"] == "status" and one["msg"].startswith("not_sub")]


@pytest.mark.parametrize("type_", ["sensor_msgs/Image", "sensor_msgs/msg/Image"])
async def test_pictures_are_on_record(subscribe, tap, type_: str):
    client = await subscribe(topic="/image", type="sensor_msgs/Image")
    tap.describe("/image", Kind(type_, "060021388200f6f0f447d0fcd9c64743"))
    tap.publish("/image", {"data": ""})
    await client.hears_op("publish")
    assert await eventually(Record.objects.filter(kind__startswith="camera.").first)


async def test_the_last_unsubscribe_ends_reading(subscribe, tap):
    client = await subscribe(id="one")
    await subscribe(client, id="two")
    await client.send("unsubscribe", topic=TOPIC)
    await tap.until(lambda wanted: not wanted)
    await client.send("unsubscribe", topic=TOPIC)
    await client.told("not_subscribed")


BAD = [
    ({"topic": TOPIC, "throttle_rate": -1}, "invalid"),
    ({"topic": TOPIC, "queue_length": -5}, "invalid"),
    ({"topic": TOPIC, "fragment_size": "small"}, "invalid"),
    ({"topic": TOPIC, "compression": "zip"}, "invalid"),
    ({"topic": "no name"}, "invalid"),
    ({"topic": TOPIC, "queue_length": 10**9}, "limited"),
    ({"topic": TOPIC, "id": "x" * 60_000}, "invalid"),
]


async def test_bad_subscriptions_are_told(open_client):
    client = await open_client("operator")
    for fields, code in BAD:
        await client.send("subscribe", **{"type": "std_msgs/String", **fields})
        assert (await client.hears_op("status"))["msg"].startswith(f"{code}: "), fields


async def test_subscriptions_are_limited(open_client, monkeypatch):
    monkeypatch.setattr("teleop.tap.feed.MOST_READINGS", 3)
    monkeypatch.setattr("teleop.rosbridge.subscribing.MOST_IDS", 2)
    client = await open_client("operator")
    for number in range(4):
        await client.send("subscribe", topic=f"/t{number}")
    await client.told("too_many_topics")
    for number in range(3):
        await client.send("subscribe", topic="/t0", id=str(number))
    await client.told("too_many_subscriptions")


async def test_reading_needs_the_scope(open_client):
    client = await open_client("operator", scopes=(Scope.DRIVE,))
    await client.send("subscribe", topic=TOPIC)
    await client.told("scope_missing")


async def test_topics_of_the_console_are_limited_too(open_client, bridge, monkeypatch):
    monkeypatch.setattr("teleop.rosbridge.subscribing.MOST_READINGS", 1)
    client = await open_client("operator")
    await client.send("subscribe", topic="/fleet/status")
    await client.send("subscribe", topic="/fleet/more")
    assert (await client.told("too_many_topics"))["level"] == "error"


async def test_no_client_speaks_under_the_name_of_a_robots_topic(open_client, subscribe, tap, bridge, allow):
    allow(Allowed("call", "/fleet/clients/words", "lab_msgs/WordsAction", "", "operator"))
    topic = "/words/feedback"
    client = await subscribe(topic=topic)
    await client.send("subscribe", topic=f"/fleet/clients{topic}")
    await client.call("/fleet/renew_control")  # its answer comes after the subscriptions
    other = await open_client("second_operator")
    await other.send("publish", topic=topic, msg={"feedback": "false"})  # the robot's type is not known yet
    await other.told("not_allowed")
    await other.send("publish", topic=f"/fleet/clients{topic}", msg={"feedback": "true"})
    assert (await client.hears_op("publish"))["topic"] == f"/fleet/clients{topic}"
    tap.describe(topic)
    tap.publish(topic, {"data": "robot"})
    assert (await client.hears_op("publish"))["msg"] == {"data": "robot"}
